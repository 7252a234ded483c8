"""Runs this program and its peers in turns and prints rates and ratios as a Markdown table."""

import argparse
import json
import os
import pathlib
import platform
import statistics
import subprocess
import sys
import time

HERE = pathlib.Path(__file__).resolve().parent
TARGET = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", HERE.parent.parent / "target"))
PROGRAM = TARGET / "release" / "reachcast"
PEERS = {"JAX vmap": "jax_vmap_peer.py", "JAX": "jax_peer.py", "PyTorch": "torch_peer.py"}
WORKLOADS = [
    *(f"rollout/{net}/{n}" for net in ("3x64", "3x128", "4x512") for n in (158, 4096, 65536)),
    "sign/race/65536",
    "mppi/lane/1024",
    "mppi/lane/16384",
]
# Too long for a first look.
LARGE = {"rollout/4x512/65536", "rollout/4x512/4096", "rollout/3x128/65536"}
# As `reachcast bench --quick` repeats its calls; it has them in its record.
PROTOCOL = {"warm_up_seconds": 0.05, "budget_seconds": 0.2}
# A workload gets no further round once it has had two and this many seconds.
PATIENCE = 30
# Between turns, so that threads of the last one have gone to sleep.
PAUSE = 0.3


class Ours:
    """This program: a process for each turn, which compiles before its clock starts."""

    def __init__(self, backend):
        self.title, self.backend = "Reachcast", backend

    def ask(self, workload):
        words = ["bench", "--quick", "--backend", self.backend, "--json", "--workload", workload]
        done = subprocess.run([PROGRAM, *words], stdout=subprocess.PIPE, check=True)
        record = json.loads(done.stdout)
        machine = record["machine"]
        self.title = f"Reachcast {record['version']}"
        self.machine = f"{machine['cpu']}, {machine['cores']} cores, {machine['instructions']}"
        if self.backend == "gpu":
            self.machine += f", {record['backends'][0]['device']}"
        (found,) = [one for one in record["workloads"] if one["name"] == workload]
        return {"rate": found["units_per_second"]}


class Peer:
    """A script that stays up and answers a line for each workload."""

    def __init__(self, name, script, folder):
        command = [sys.executable, "-B", HERE / script, folder]
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
        self.process = subprocess.Popen(command, text=True, bufsize=1, **pipes)
        hello = self.answer()
        self.title = hello.get("title", name)
        self.absent = hello.get("absent") or hello.get("refused")

    def ask(self, workload):
        print(json.dumps({"workload": workload, **PROTOCOL}), file=self.process.stdin, flush=True)
        return self.answer()

    def answer(self):
        line = self.process.stdout.readline()
        return json.loads(line) if line else {"refused": "the script ended"}

    def close(self):
        self.process.stdin.close()
        self.process.wait()


def rounds_of(workload, parties, most):
    """The answers of each party, round by round, each party's turn right after the other's."""
    begun, answers = time.monotonic(), []
    while len(answers) < most and (len(answers) < 2 or time.monotonic() - begun < PATIENCE):
        answers.append([])
        for party in parties:
            time.sleep(PAUSE)
            answers[-1].append(party.ask(workload))
        print(f"{workload}: round {len(answers)}", file=sys.stderr)
    return list(zip(*answers))


def short(rate):
    """A rate with three digits."""
    scale, unit = next(s for s in ((1e6, " M"), (1e3, " k"), (1, "")) if rate >= s[0] or s[0] == 1)
    digits = 2 if rate / scale < 10 else 1 if rate / scale < 100 else 0
    return f"{rate / scale:.{digits}f}{unit}"


def spread(values, show):
    """Median, smallest and largest."""
    middle = show(statistics.median(values))
    return middle if len(values) == 1 else f"{middle} ({show(min(values))} to {show(max(values))})"


def cells(ours, theirs):
    """Rate and ratio of a peer: the median over rounds of the ratio within a round."""
    refused = [answer["refused"] for answer in theirs if "refused" in answer]
    if refused:
        return [refused[0], "-"]
    rates = [answer["rate"] for answer in theirs]
    ratios = [mine / rate for mine, rate in zip(ours, rates)]
    return [spread(rates, short), spread(ratios, lambda ratio: f"{ratio:.2f}")]


def row(workload, answers):
    mine = [answer["rate"] for answer in answers[0]]
    peers = [cell for theirs in answers[1:] for cell in cells(mine, theirs)]
    return [f"`{workload}`", str(len(mine)), spread(mine, short), *peers]


def line(cells):
    return "| " + " | ".join(cells) + " |"


def arguments():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="two rounds, no large workload")
    parser.add_argument("--workload", default="", help="only those whose name contains this")
    parser.add_argument("--backend", choices=("cpu", "gpu"), default="cpu", help="ours; cpu")
    parser.add_argument("--rounds", type=int, default=5, help="most rounds of a workload")
    return parser.parse_args()


def main():
    asked = arguments()
    chosen = [name for name in WORKLOADS if asked.workload in name]
    if not chosen:
        sys.exit(f"--workload {asked.workload}: no name contains it; there are {WORKLOADS}")
    if asked.quick and not asked.workload:
        chosen = [name for name in chosen if name not in LARGE]
    folder = TARGET / "peers"
    subprocess.run([PROGRAM, "bench", "-q", "--export", folder], check=True)
    ours, scripts = Ours(asked.backend), [Peer(name, script, folder) for name, script in PEERS.items()]
    peers = [peer for peer in scripts if not peer.absent]
    most = min(asked.rounds, 2) if asked.quick else asked.rounds
    rows = [row(name, rounds_of(name, [ours, *peers], most)) for name in chosen]
    for peer in scripts:
        peer.close()
    print(f"{ours.machine}; {platform.system()}, Python {platform.python_version()}; "
          f"{', '.join([ours.title, *(peer.title for peer in scripts)])}; processors on all cores.\n"
          "Units per second: median (smallest to largest) over rounds in which each takes its turn; "
          "ratio: this program over the peer within a round.\n")
    heads = [head for peer in peers for head in (peer.title, "ratio")]
    print(line(["workload", "rounds", ours.title, *heads]))
    print(line(["---"] * (3 + len(heads))))
    for cells_of_row in rows:
        print(line(cells_of_row))
    print("\n`sign`: of this program signs alone, which end early; of the peers measures, since they "
          "have no early exit.")
    for peer in scripts:
        if peer.absent:
            print(f"\n{peer.title}: absent ({peer.absent}).")


if __name__ == "__main__":
    main()
