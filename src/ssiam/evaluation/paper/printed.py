"""`printed_tables`: the rows of the paper for which there are no results at all."""

from __future__ import annotations

from collections.abc import Iterable

from ssiam.evaluation.paper.cells import (
    ABLATION_NAME,
    TABLE3_COLUMNS,
    Table,
    paper_head,
    plain_cells,
    published_method,
    table4_cells,
    table4_head,
)
from ssiam.evaluation.paper.missing import missing_result
from ssiam.evaluation.paper.published import (
    ABLATION_TRACKER,
    ABLATION_YEAR,
    TABLE1,
    TABLE2,
    TABLE3,
    TABLE4,
)


def printed_tables(shown: Iterable[Table], years: Iterable[int | None]) -> list[Table]:
    """What the paper prints that no table of the results contains, and what would fill it.

    Parameters
    ----------
    shown : iterable of Table
        The tables of the results.
    years : iterable of int or None
        VOT years of their datasets.
    """
    present = {each.title.partition(":")[0] for each in shown if each.rows}
    known = set(years)
    data = "" if ABLATION_YEAR in known else f"VOT{ABLATION_YEAR}, "
    label = f"{ABLATION_NAME}-paper"
    tables = [
        Table(
            "Table 1 as printed in the paper, other datasets",
            ("dataset", "tracker", "stabilized", *paper_head(), "missing"),
            [
                (
                    *(f"VOT{each.year}", each.tracker, published_method(each)),
                    *plain_cells(each.measures),
                    f"VOT{each.year}, {missing_result(each.label, 'table1')}",
                )
                for each in TABLE1
                if each.year not in known
            ],
        )
    ]
    of_what = f"{ABLATION_TRACKER} on VOT{ABLATION_YEAR}"
    if "Table 2" not in present:
        missing = data + missing_result(label, "table2")
        tables.append(
            Table(
                f"Table 2 as printed in the paper, {of_what}",
                ("keypoints", *paper_head(), "missing"),
                [(name, *plain_cells(each), missing) for name, each in TABLE2.items()],
            )
        )
    if "Table 3" not in present:
        missing = data + missing_result(label, "table3")
        tables.append(
            Table(
                f"Table 3 as printed in the paper, {of_what}",
                ("threshold", "value", *paper_head(TABLE3_COLUMNS), "missing"),
                [
                    (threshold, f"{value:g}", *plain_cells(each, TABLE3_COLUMNS), missing)
                    for threshold, by_value in TABLE3.items()
                    for value, each in by_value.items()
                ],
            )
        )
    if ABLATION_YEAR not in known:
        missing = data + missing_result(label, "table4")
        tables.append(
            Table(
                f"Table 4 as printed in the paper, {of_what}",
                ("sequence", *table4_head(TABLE4)[:3], "missing"),
                [(name, *table4_cells(name, TABLE4, {}, "")[:3], missing) for name in TABLE4],
            )
        )
    return [each for each in tables if each.rows]
