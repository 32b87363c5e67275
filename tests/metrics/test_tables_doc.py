"""The documentation describes every column of metrics and signals as the code declares it."""

import pytest
from support.tables_doc import TABLES, find_table


@pytest.mark.parametrize(("page", "heading"), TABLES)
def test_a_page_has_every_column_as_it_is_declared(page, heading):
    """``python tests/support/tables_doc.py`` renews the pages."""
    assert find_table(page, heading)[1][0] == TABLES[page, heading]
