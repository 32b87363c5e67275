"""The page "Learn in the browser": ``benchmarks/one_leg.c`` as WebAssembly, and the plans that it runs on.

mkdocs calls this when it builds the site. Where no clang makes WebAssembly it prints one line and leaves out what the
page shows. ``docs/leg.js`` reads what is packed here, ``docs/browser.js`` draws it.
"""

import base64
import json
import subprocess
import tempfile
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.c_loop import SOURCE, TABLES, CLaw, CState, make_law, make_state, make_tables
from benchmarks.timing import make_config
from cmacexp.cmac.addressing import quantise
from cmacexp.loop.scenario import make_scenario, resolve_rate
from cmacexp.models.loop_delay import LoopDelay

DOCS = Path(__file__).parent
PAGE, DATA = "browser.md", "browser-data.js"
FLAGS = (
    "--target=wasm32", "-Os", "-ffreestanding", "-nostdlib", "-mbulk-memory", "-ffp-contract=off",
    "-Wl,--no-entry,--export=one_leg,--export=__heap_base,--strip-all",
)  # fmt: skip
SCENARIO = ("scenario=one_leg", "reference=aware")
STIFFNESSES = (8, 10, 14, 20, 30, 50, 100)
"""Of the ground that the page offers, N/m: each has a plan of its own."""
DELAYS = range(5)
"""Of the torques that the page offers, samples."""
SET = ("mass_1", "mass_2", "rate", "delay", "lead", "guarded", "start_step")
READ = ("taken", "phase", "cause", "acted", "best_cycle")
"""Fields of ``Law`` that leg.js sets, and of ``State`` that it reads."""
SHARED = ("support", "low", "high", "shift")
"""Tables that are the same on any ground."""
PLACE = "{{ learn }}"
"""Where the page shows it."""
SCRIPTS = (DATA, "leg.js", "browser.js")
SHOWN = """<link rel="stylesheet" href="browser.css">
<div id="learn"><noscript>This page needs JavaScript.</noscript></div>
"""
WITHOUT = "This copy of the site was built without clang, which compiles the leg for your browser."


def compile_leg() -> bytes | None:
    """``one_leg.c`` as WebAssembly, for CMACs of the shape of conf/cmac/one_leg.yaml; None without a clang for it."""
    cmac = make_config(*SCENARIO).cmac
    sizes = [f"-DLAYERS={cmac.layers}", f"-DINPUTS={2 * len(cmac.inputs)}"]
    with tempfile.TemporaryDirectory() as folder:
        module = Path(folder) / "one_leg.wasm"
        try:
            subprocess.run(["clang", *FLAGS, *sizes, str(SOURCE), "-o", str(module)], check=True, capture_output=True)
        except (OSError, subprocess.CalledProcessError):
            return None
        return module.read_bytes()


def pack(content: bytes) -> str:
    """Bytes as a text that leg.js inflates."""
    return base64.b64encode(zlib.compress(content, 9)).decode()


def pointer_offset(name: str) -> int:
    """Where a table's pointer of 4 bytes is in ``Law`` of WebAssembly; of no name: where ``Law`` ends."""
    end = len(TABLES) + len(TABLES) % 2
    return int(CLaw.support.offset) + 4 * (TABLES.index(name) if name else end)


def start_leg(stiffness: float) -> tuple[bytes, dict[str, Any]]:
    """Law and state of a leg on ground of this stiffness, N/m, and its tables.

    The inputs of the CMAC are whole quanta here, which address the same cells as the inputs of any in them.
    """
    scenario = make_scenario(make_config(*SCENARIO, f"terrain.stiffness={stiffness}"))
    tables = make_tables(scenario)
    address = scenario.feedforward.cmacs[0].address
    quanta = (address.resolution_elements - 1) * address.displacement.shape[0]
    tables["inputs"] = quantise(tables["inputs"], tables["low"], tables["high"], quanta)
    tables["low"], tables["high"] = 0.0 * tables["low"], 0.0 * tables["high"] + quanta
    law = bytes(make_law(scenario, tables))[: pointer_offset("support")].ljust(pointer_offset(""), b"\0")
    return law + bytes(make_state(scenario)), tables


def pack_plans(plans: Sequence[tuple[bytes, Mapping[str, Any]]]) -> str:
    """Legs of :func:`start_leg` by columns, since those of different ground are alike: a quarter of the size.

    Law and state of each, shared tables, references (columns, S, 2, N), differences of quanta (columns, S, N).
    """
    reference = np.array([tables["reference"] for _, tables in plans]).transpose(3, 0, 1, 2)
    quanta = np.array([tables["inputs"] for _, tables in plans]).transpose(2, 0, 1)
    steps = np.diff(quanta, axis=2, prepend=0).astype("<i2")
    shared = [plans[0][1][name] for name in SHARED]
    starts = b"".join(start for start, _ in plans)
    return pack(starts + b"".join(table.tobytes() for table in (*shared, reference, steps)))


def make_data(module: bytes) -> str:
    """The script that the page loads: the compiled leg, where its fields are, and what it runs on."""
    config = make_config(*SCENARIO)
    guarded = make_config(*SCENARIO, "learning.guard=freeze", "learning.rate=1")
    plans = [start_leg(stiffness) for stiffness in STIFFNESSES]
    tables, leg = plans[0][1], config.machine.leg
    data = {
        "wasm": pack(module),
        "law": {name: getattr(CLaw, name).offset for name in SET},
        "law_bytes": pointer_offset(""),
        "state": {name: getattr(CState, name).offset for name in READ},
        "state_bytes": len(bytes(CState())),
        "tables": [(name, pointer_offset(name), tables[name].nbytes) for name in TABLES],
        "shared": SHARED,
        "stiffnesses": STIFFNESSES,
        "plans": pack_plans(plans),
        "guarded_rates": [resolve_rate(guarded, LoopDelay(delay), 0) for delay in DELAYS],
        "period": config.steps_per_cycle,
        "transfer": round((1.0 - config.gait.duty_factor) * config.steps_per_cycle),
        "sampling_period": config.sampling_period,
        "lengths": [leg.length_1, leg.length_2],
        "hip_height": config.machine.hip_height,
        "force": config.force_control.desired_force,
    }
    return f"globalThis.cmacexpData = {json.dumps(data)};\n"


_made: dict[str, str] = {}
"""The packed script by its name; empty without clang."""


def on_config(config: Any) -> Any:
    """Make the script, or leave the page out of the navigation; mkdocs calls this once."""
    module = compile_leg()
    if module is not None:
        _made[DATA] = make_data(module)
        return config
    print(f"{PAGE} is left out: no clang makes WebAssembly here; install clang and lld")
    for group in config.nav:
        for section in filter(lambda value: isinstance(value, list), group.values()):
            section[:] = [entry for entry in section if not (isinstance(entry, dict) and PAGE in entry.values())]
    return config


def on_files(files: Any, config: Any) -> Any:
    """Add the script; mkdocs calls this once."""
    from mkdocs.structure.files import File, InclusionLevel

    for name, content in _made.items():
        files.append(File.generated(config, name, content=content))
    if not _made:  # links to the page hold all the same
        files.get_file_from_path(PAGE).inclusion = InclusionLevel.NOT_IN_NAV
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Show the leg where the page has its place, or say why not; mkdocs calls this for every page."""
    shown = SHOWN + "".join(f'<script src="{name}"></script>\n' for name in SCRIPTS) if _made else WITHOUT
    return markdown.replace(PLACE, shown)
