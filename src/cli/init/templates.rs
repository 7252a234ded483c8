//! The plants that a configuration may start from: those of `configs/models`, carried in the program.

use std::path::Path;

/// A plant to start from.
pub(super) struct Template {
    /// Its name.
    pub(super) name: &'static str,
    /// What it is, in a line.
    pub(super) about: &'static str,
    /// The configuration.
    text: &'static str,
    /// The files that it names.
    pub(super) files: &'static [Copy],
    /// A parameter with two values to compare.
    varied: &'static str,
}

/// A file that a configuration names.
pub(super) struct Copy {
    /// How the carried configuration names it.
    named: &'static str,
    /// Its name beside the configuration.
    pub(super) name: &'static str,
    /// What is in it.
    pub(super) bytes: &'static [u8],
}

/// The text of a configuration of `configs/models`.
macro_rules! text {
    ($name:literal) => {
        include_str!(concat!("../../../configs/models/", $name))
    };
}

/// The bytes of a file below `configs/models`.
macro_rules! bytes {
    ($name:literal) => {
        include_bytes!(concat!("../../../configs/models/", $name))
    };
}

/// All of them, the one that a newcomer starts from first.
pub(super) const TEMPLATES: [Template; 11] = [
    Template {
        name: "cart-pole",
        about: "a pole on a cart, kept upright and on its track",
        text: text!("cart_pole.toml"),
        files: &[],
        varied: "mass.value=0.05,0.1,0.2",
    },
    Template {
        name: "pendulum",
        about: "a rod that hangs, swung up and held",
        text: text!("pendulum.toml"),
        files: &[],
        varied: "",
    },
    Template {
        name: "double-integrator",
        about: "a mass on a line, to the middle without leaving the corridor",
        text: text!("double_integrator.toml"),
        files: &[],
        varied: "target.value=0.2,0.25,0.3",
    },
    Template {
        name: "dubins",
        about: "a car of one speed around an obstacle",
        text: text!("dubins.toml"),
        files: &[],
        varied: "",
    },
    Template {
        name: "bicycle",
        about: "a kinematic bicycle and an obstacle that moves",
        text: text!("bicycle.toml"),
        files: &[],
        varied: "",
    },
    Template {
        name: "diff-drive",
        about: "two wheels in a room with pillars",
        text: text!("diff_drive.toml"),
        files: &[Copy {
            named: "diff_drive_room.npy",
            name: "diff_drive_room.npy",
            bytes: bytes!("diff_drive_room.npy"),
        }],
        varied: "",
    },
    Template {
        name: "planar-quadrotor",
        about: "a quadrotor in the plane",
        text: text!("planar_quadrotor.toml"),
        files: &[],
        varied: "",
    },
    Template {
        name: "quadrotor",
        about: "a quadrotor in space",
        text: text!("quadrotor.toml"),
        files: &[],
        varied: "",
    },
    Template {
        name: "learned-pendulum",
        about: "a pendulum whose step is a network",
        text: text!("learned_pendulum.toml"),
        files: &[Copy {
            named: "learned_pendulum.safetensors",
            name: "learned_pendulum.safetensors",
            bytes: bytes!("learned_pendulum.safetensors"),
        }],
        varied: "",
    },
    Template {
        name: "two-tanks",
        about: "two tanks in a row, the level of the second brought to a height and held there",
        text: text!("two_tanks.toml"),
        files: &[],
        varied: "hole.value=0.4,0.5,0.6",
    },
    Template {
        name: "drone-race",
        about: "two drones and a gate, the ego under a trained network",
        text: text!("drone_race.toml"),
        files: &[Copy {
            named: "../policies/race_policy.safetensors",
            name: "race_policy.safetensors",
            bytes: bytes!("../policies/race_policy.safetensors"),
        }],
        varied: "",
    },
];

/// What else may stand in a configuration, section by section, with what holds where it does not.
const SECTIONS: [(&str, &str); 9] = [
    (
        "[model.costs]",
        "# What sampled plans (`reachcast plan`) pay: at each stage, and at the end. The names are yours.
# [model.costs]
# stage.effort = { weight = 0.1, formula = \"...\" }
# terminal.place = { weight = 10.0, formula = \"...\" }
",
    ),
    (
        "[rollout]",
        "# How long a rollout is, and how much a later step counts.
# [rollout]
# horizon = 30 # steps
# gamma = 0.95 # discount per step; 1.0 for none
",
    ),
    (
        "[deviation]",
        "# The perturbation that a certificate allows for: every start within this distance of a certified one.
# [deviation]
# radius = 0.02
# control = \"replay\" # the controls of the nominal start. An unstable plant needs \"closed-loop\": the policy sees
#                      # the perturbed start too, where replayed controls would let it drift away
# epsilon = 0.1 # risk
# beta = 0.001 # one minus the confidence
",
    ),
    (
        "[global]",
        "# The certified set.
# [global]
# draws = 20000 # pairs that its conditional failure is counted on
# risk = 0.005 # refused where it is not obtained; without it, it is looked for
",
    ),
    (
        "[growth]",
        "# The set that grows around a start at the boundary of the certified set.
# [growth]
# radius = 0.2 # the largest one that is tried
",
    ),
    (
        "[slice]",
        "# The two states of the picture, the others as in [state].
# [slice]
# x = { state = \"...\", from = -1.0, to = 1.0, step = 0.1 }
# y = { state = \"...\", from = -1.0, to = 1.0, step = 0.1 }
",
    ),
    (
        "[state]",
        "# The state of the slice and of growth, and where a single run of `plan` starts: the middle of the box.
# [state]
# name_of_a_state = 0.1
",
    ),
    (
        "[plan]",
        "# Sampled plans in closed loop.
# [plan]
# samples = 1024
# horizon = 30 # steps of a plan
# temperature = 1.0 # in units of cost
# runs = 1 # more than one start from draws of the box
",
    ),
    (
        "[train]",
        "# Training (`reachcast train`, in a program built with `--features train`).
# [train]
# method = \"analytic\" # or value, action-value, ppo, ddpg
# hidden = [64, 64]
",
    ),
];

impl Template {
    /// The configuration as it is written to `file`.
    pub(super) fn text(&self, file: &Path) -> String {
        let own = self
            .files
            .iter()
            .fold(self.text.to_owned(), |text, copy| text.replace(copy.named, copy.name));
        let head = format!(
            "# A starting configuration, `reachcast init --from {}`. Change what is yours, then:\n{}\n",
            self.name,
            self.commands(file).lines().map(|line| format!("# {line}\n")).collect::<String>()
        );
        let own = match own.contains("control = \"closed-loop\"\n") {
            true => own.replace(
                "control = \"closed-loop\"\n",
                "control = \"closed-loop\" # the policy sees the perturbed start too; else its nominal controls are replayed\n",
            ),
            false => own,
        };
        let absent = |(section, _): &&(&str, &str)| !own.lines().any(|line| is_of(line, section));
        let rest: String =
            SECTIONS.iter().filter(absent).map(|(_, text)| format!("\n{text}")).collect();
        format!(
            "{head}{own}\n# What else may stand here, with what holds without it; docs/models.md has all of it.\n{rest}"
        )
    }

    /// The commands that go on from `file`.
    pub(super) fn commands(&self, file: &Path) -> String {
        let file = file.display();
        let mut lines = format!(
            "  reachcast certify {file} --out certified   # from which states it succeeds, at which risk\n"
        );
        if self.text.contains("[model.costs]") {
            lines += &format!(
                "  reachcast plan {file} --out planned        # sampled plans in closed loop\n"
            );
        }
        lines += &format!(
            "  reachcast train {file} --out trained       # a network in place of the policy\n"
        );
        if !self.varied.is_empty() {
            let varied = self.varied;
            lines += &format!(
                "  reachcast sweep {file} --of certificate --vary model.parameters.{varied} --out swept\n"
            );
        }
        lines
    }
}

/// Whether `line` opens `section`, or a section below it.
fn is_of(line: &str, section: &str) -> bool {
    let name = section.trim_end_matches(']');
    line.trim_start().strip_prefix(name).is_some_and(|rest| rest.starts_with([']', '.']))
}
