"""The documentation describes every column of metrics and signals as the code declares it."""

import re

import pytest
from support.tables_doc import COLUMNS, DOCS, TABLES, find_table


@pytest.mark.parametrize(("page", "heading"), TABLES)
def test_a_page_has_every_column_as_it_is_declared(page, heading):
    """``python tests/support/tables_doc.py`` renews the pages."""
    assert find_table(page, heading)[1][0] == TABLES[page, heading]


def test_every_source_is_listed_in_full():
    listed = (DOCS / "metrics.md").read_text().split("\n## Sources\n")[1]
    for source in {column.source for columns in COLUMNS.values() for column in columns.values()}:
        found = re.search(r"[A-Z][^:]*? \d{4}", source)
        assert f"- **{found[0] if found else source}**" in listed
