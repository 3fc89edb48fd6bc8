"""Makes the edits of repairs in the layers of an open stage."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from lab3_usd.model import repair
from lab3_usd.model.repair import Edit
from lab3_usd.stage.edit.moves import move_prim
from lab3_usd.stage.edit.prims import (
    activate,
    add_graph,
    add_node,
    apply_schema,
    remove_prim,
    remove_schema,
)
from lab3_usd.stage.edit.properties import (
    clear_value,
    connect,
    rename_property,
    set_targets,
    set_value,
)
from lab3_usd.stage.edit.restore import restore
from lab3_usd.stage.edit.session import EditSession

_EDITORS: Mapping[type, Callable[[EditSession, Any], None]] = {
    repair.SetValue: set_value,
    repair.ClearValue: clear_value,
    repair.Connect: connect,
    repair.Retarget: set_targets,
    repair.RenameProperty: rename_property,
    repair.ApplySchema: apply_schema,
    repair.RemoveSchema: remove_schema,
    repair.Activate: activate,
    repair.Restore: restore,
    repair.AddNode: add_node,
    repair.AddGraph: add_graph,
    repair.RemovePrim: remove_prim,
    repair.MovePrim: move_prim,
}


def apply_edit(session: EditSession, edit: Edit) -> None:
    """Make one edit; nothing is written to a file."""
    _EDITORS[type(edit)](session, edit)
