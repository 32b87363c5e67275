"""Recordings as Rerun's own reader finds them."""

import numpy as np
from rerun.chunk import RrdReader


def read_rows(path, content="/**", store=None, **options):
    """Entity and columns of each row of some entities of a recording."""
    reader = RrdReader(path)
    stream = reader.stream(store=store(reader)) if store else reader.stream().filter(content=content, **options)
    for chunk in stream.to_chunks():
        for row in chunk.to_record_batch().to_pylist():
            yield chunk.entity_path, row


def values(path, entity, component):
    """Steps and values (steps, ...) of one component of an entity, in the order of the steps."""
    rows = read_rows(path, f"/{entity}", has_timeline="step")
    found = sorted((row["step"], row[component]) for _, row in rows if component in row)
    return np.array([step for step, _ in found]), np.array([value for _, value in found])


def lines(path, plot, root=""):
    """Steps and values (steps, lines) of a plot, such as leg_1/force."""
    return values(path, f"{root}series", plot.replace("/", ":"))


def entities(path):
    return {entity for entity, _ in read_rows(path)}
