"""What becomes of the commanded torque on its way to the joints."""

from cmacexp.arrays import Array
from cmacexp.compile import kernel


@kernel
def saturate(limit: float, feedback: Array, feedforward: Array, torque: Array) -> None:
    """Hold the torque of every joint to ``limit`` N m; the feedback gives way first.

    Args:
        limit: largest absolute torque; infinite for none.
        feedback: (L, 2): shortened in place.
        feedforward: (L, 2): shortened in place where it alone exceeds the limit.
        torque: (L, 2): is filled with the sum of both, which is what the plant gets.
    """
    for i in range(torque.shape[0]):
        for j in range(2):
            feedforward[i, j] = min(max(feedforward[i, j], -limit), limit)
            total = feedback[i, j] + feedforward[i, j]
            if total > limit:
                feedback[i, j] = limit - feedforward[i, j]
            elif total < -limit:
                feedback[i, j] = -limit - feedforward[i, j]
            torque[i, j] = feedback[i, j] + feedforward[i, j]
