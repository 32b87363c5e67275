"""Hashing: from 64 words to a row for every visited cell (left open by Lin & Song 1997, section 4).

``python -m pipelines.hashing`` gives the CMAC of one leg and those of the quadruped less and less memory, with five
seeds of the hash, for 20 cycles of the paper's rule and 1,000 of a rule that lasts. What it claims: collisions cost
accuracy before they cost stability, and a path is so short that they can be avoided altogether. It takes about five
minutes on two cores.
"""

from cmacexp.report.page import Drawing, Section
from pipelines.analysis import hashing_words as words
from pipelines.analysis.hashing_figures import over_memory
from pipelines.analysis.hashing_found import addressing_cost, found
from pipelines.shared.runs import Runs
from pipelines.shared.study import Jobs, Study, main

LEG, WALK = "one leg", "quadruped"
MEMORIES = {LEG: (*(2**n for n in range(9, 17)), 2**18, 2**20), WALK: (*(2**n for n in range(9, 16)), 2**16, 2**18)}
"""Bytes of one leg; the last is the paper's, the first the least that 32 layers of two outputs allow."""
SEEDS = 5
PAPER, LASTING = "the paper's rule", "leakage, lead 1"
RULES = {
    PAPER: ("learning.rule=paper", "learning.lead=0"),
    LASTING: ("learning.rule=leakage", "learning.lead=1"),
}
RAMPED = {(WALK, LASTING): ("gait.load_ramp=0.12",)}
"""Under a body errors of force at touch-down would hide what collisions cost."""
THIN = "record.cycles=[1]"
FREE = "collision-free"


def jobs(quick: bool) -> Jobs:
    """Every memory and seed, and a row for every visited cell, by machine and rule."""
    cycles = {PAPER: 4, LASTING: 6} if quick else {PAPER: 20, LASTING: 1000}
    runs = {}
    for machine, scenario in ((LEG, "one_leg"), (WALK, "quadruped")):
        memories = (MEMORIES[machine][2], MEMORIES[machine][-1]) if quick else MEMORIES[machine]
        for rule, overrides in RULES.items():
            common = [
                f"scenario={scenario}",
                f"cycles={cycles[rule]}",
                THIN,
                *overrides,
                *RAMPED.get((machine, rule), ()),
            ]
            for memory in memories:
                for seed in range(2 if quick else SEEDS):
                    runs[f"{machine}, {rule}, {memory} B, seed {seed}"] = [
                        *common, f"cmac.memory_bytes={memory}", f"seed={seed}"
                    ]  # fmt: skip
            runs[f"{machine}, {rule}, {FREE}"] = [*common, "cmac.addressing=visited"]
    return runs


def summarise(runs: Runs) -> list[Section]:
    """One leg with the cost of the hash, and the quadruped; each ends in advice."""
    cost = runs.keep("addressing.parquet", addressing_cost())
    sections = []
    for machine in (LEG, WALK):
        rules, names = {}, []
        for rule in RULES:
            own = [name for name in runs if name.startswith(f"{machine}, {rule}, ")]
            base = next(name for name in own if f" {MEMORIES[machine][-1]} B, seed 0" in name)
            rules[rule] = found((runs[name] for name in own), runs[base])
            names += [base, next(name for name in own if name.endswith(FREE))]
        drawing = Drawing(f"hashing_{machine.replace(' ', '_')}", over_memory(rules), words.caption(rules, machine))
        more = [words.cost(cost)] if machine == LEG else []
        content = [drawing, words.table(rules), *more, *words.advice(rules)]
        sections.append(Section(f"Hashing: {machine}", content, [words.claim(rules, runs, names)], beyond=True))
    return sections


STUDY = Study(
    "hashing",
    "Hashing: from 64 words to a row for every cell",
    "Collisions of hashed memory against accuracy and convergence, over seeds of the hash, in short runs of the "
    "paper's rule and in long ones of a rule that lasts.",
    jobs,
    summarise,
)

if __name__ == "__main__":
    main(STUDY)
