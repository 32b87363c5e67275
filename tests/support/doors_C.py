"""What tests of learning need of other rooms and find at no door yet."""

from cmacexp.jit.compiler import expect_steps as expect_steps
