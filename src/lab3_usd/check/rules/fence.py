"""Rules about what a grader does not open: files and references that reach out of a submission."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.finding import Problem
from lab3_usd.check.registry import rule


@rule("Z01", "file-left-out", scope="file")
def file_left_out(path: str, reason: str) -> Iterator[Problem]:
    """A file of the submission was not opened.

    Why: links, pipes and devices reach out of a submission, and damaged, encrypted or gigantic
    files cannot be judged. Everything else in the submission is judged all the same.

    Fix: hand in plain files, in a folder or a .zip archive without a password.

    Example: `work/Lab3_05_odometry_tf.usda` is a symbolic link to a file in somebody's home.
    """
    yield Problem(path, f"this file is left out: {reason}", handout="6.1")


@rule("Z02", "reference-left-out", scope="file")
def reference_left_out(asset: str, reason: str) -> Iterator[Problem]:
    """A stage refers to something that a submission must not reach.

    Why: a stage is judged by what was handed in. What lies elsewhere is not opened, and a graph
    cannot be judged by a file that is not there.

    Fix: keep the graphs in the stage itself, and hand in assets beside it, with relative paths
    that stay inside the submission; in Isaac Sim, File > Collect As does that.

    Example: `references = @../../solution/Lab3_05_odometry_tf.usda@`.
    """
    yield Problem("/", f"{asset} is not opened: {reason}", actual=asset, handout="6.1")
