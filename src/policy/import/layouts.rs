//! The layouts of libraries: what their networks are called, and what lies between and around the layers.

use super::dense::Dense;
use super::layers::in_order;
use super::names::{around, split, starts_with, under};
use super::source::Source;
use crate::policy::Activation;

/// How a library calls the parts of a policy.
#[derive(Debug)]
pub(super) struct Layout {
    /// The library, and what it trains so.
    pub(super) name: &'static str,
    /// Modules of its layers, one after the other.
    body: &'static [&'static str],
    /// What lies beside them; of several words between bars, one.
    marks: &'static [&'static str],
    /// What else lies beside them, and is no part of the policy, whatever its names.
    beside: &'static [&'static str],
    /// Between the layers, unless something else is stated.
    pub(super) hidden: Activation,
    /// Behind the last layer, unless something else is stated.
    pub(super) last: Activation,
    /// A layer whose sums stay within a limit and its negative, and the limit that the library has by default.
    pub(super) clipped: Option<(&'static str, f64)>,
    /// Factors of what comes out, and what is added then.
    pub(super) scaled: Option<[&'static str; 2]>,
    /// Whether the last layer also gives deviations, in its second half.
    pub(super) doubled: bool,
    /// Why the file does not say what the network gives, so that it has to be asked for by name.
    pub(super) refusal: Option<&'static str>,
    /// What the library does with the output that no file of its says.
    pub(super) beyond: Option<&'static str>,
    /// The same, of a library whose archives say it.
    pub(super) unsaid: Option<&'static str>,
}

impl Layout {
    /// What in a file is known to be no part of the policy: what marks the layout, and what lies beside it.
    pub(super) fn beside(&self, outer: &str) -> Vec<String> {
        let marks = self.marks.iter().flat_map(|marks| marks.split('|'));
        // Means of observations are lost where they are not used.
        let marks = marks.filter(|mark| split(mark).1 != "mean");
        let own = marks.chain(self.beside.iter().copied());
        own.map(|name| under(outer, name))
            .chain(self.beside.iter().map(|&name| name.to_owned()))
            .collect()
    }
}

/// Every layout has these unless it says otherwise.
const PLAIN: Layout = Layout {
    name: "",
    body: &[],
    marks: &[],
    beside: &[],
    hidden: Activation::Relu,
    last: Activation::Tanh,
    clipped: None,
    scaled: None,
    doubled: false,
    refusal: None,
    beyond: None,
    unsaid: None,
};
const ELU: Activation = Activation::Elu { alpha: 1.0 };
/// What CleanRL calls the limits of its actions.
const ACTIONS: Option<[&str; 2]> = Some(["action_scale", "action_bias"]);
/// What several libraries do behind the tanh.
const LIMITS: Option<&str> =
    Some("the largest action, which the output is multiplied by; the file does not say it");
/// What stable-baselines3 does with the output, which its archives say and its state dicts do not.
const CLAMPED: Option<&str> = Some(
    "the limits of the actions, which predict() keeps the output within; a state dict does not say them, model.save(FILE) \
     does",
);
const SCALED: Option<&str> = Some(
    "the limits of the actions, to which predict() scales the output, here within -1 and 1; a state dict does not say \
     them, model.save(FILE) does",
);
const GAUSSIAN: (Activation, Activation) = (Activation::Tanh, Activation::Identity);

/// The layouts, those with more parts first.
const LAYOUTS: [Layout; 23] = [
    Layout {
        name: "Brax",
        body: &["1.params.hidden_"],
        marks: &["0.mean"],
        beside: &["0.count", "0.summed_variance", "2"],
        hidden: Activation::Silu,
        doubled: true,
        ..PLAIN
    },
    Layout {
        name: "stable-baselines3 (PPO, A2C)",
        unsaid: CLAMPED,
        body: &["mlp_extractor.shared_net", "mlp_extractor.policy_net", "action_net"],
        marks: &["value_net"],
        hidden: GAUSSIAN.0,
        last: GAUSSIAN.1,
        ..PLAIN
    },
    Layout {
        name: "stable-baselines3 (PPO, A2C)",
        unsaid: CLAMPED,
        body: &["mlp_extractor.policy_net", "action_net"],
        marks: &["value_net"],
        hidden: GAUSSIAN.0,
        last: GAUSSIAN.1,
        ..PLAIN
    },
    Layout {
        name: "stable-baselines3 (SAC)",
        unsaid: SCALED,
        body: &["actor.latent_pi", "actor.mu"],
        marks: &["actor.log_std"],
        // With exploration that depends on the state, the means go through a Hardtanh, which has no tensor.
        clipped: Some(("actor.mu.0", 2.0)),
        ..PLAIN
    },
    Layout {
        name: "stable-baselines3 (TD3, DDPG)",
        unsaid: SCALED,
        body: &["actor.mu"],
        marks: &["actor_target.mu"],
        ..PLAIN
    },
    Layout {
        name: "rl_games",
        body: &["a2c_network.actor_mlp", "a2c_network.mu"],
        marks: &["a2c_network.value"],
        beside: &["a2c_network.sigma", "value_mean_std", "assymetric_vf_nets"],
        hidden: ELU,
        last: Activation::Identity,
        ..PLAIN
    },
    Layout {
        name: "rsl_rl",
        body: &["model_state_dict.actor"],
        marks: &["model_state_dict.critic", "model_state_dict.std|model_state_dict.log_std"],
        hidden: ELU,
        last: Activation::Identity,
        ..PLAIN
    },
    // Actors beside a critic and a `log_std` are anybody's.
    Layout {
        name: "rsl_rl",
        body: &["actor"],
        marks: &["critic", "std"],
        hidden: ELU,
        last: Activation::Identity,
        ..PLAIN
    },
    Layout {
        name: "rsl_rl",
        body: &["actor_state_dict.mlp"],
        marks: &["critic_state_dict"],
        beside: &["actor_state_dict.distribution"],
        hidden: ELU,
        last: Activation::Identity,
        ..PLAIN
    },
    Layout {
        name: "CleanRL (PPO)",
        body: &["actor_mean"],
        marks: &["actor_logstd"],
        hidden: GAUSSIAN.0,
        last: GAUSSIAN.1,
        ..PLAIN
    },
    Layout {
        name: "CleanRL (SAC)",
        body: &["fc1", "fc2", "fc_mean"],
        marks: &["fc_logstd", "action_scale", "action_bias"],
        scaled: ACTIONS,
        ..PLAIN
    },
    Layout {
        name: "CleanRL (TD3, DDPG)",
        body: &["fc1", "fc2", "fc_mu"],
        marks: &["action_scale", "action_bias"],
        // Its critics follow the actor in a tuple.
        beside: &["1", "2", "3"],
        scaled: ACTIONS,
        ..PLAIN
    },
    Layout {
        name: "omnisafe",
        body: &["pi.mean"],
        marks: &["pi.log_std"],
        hidden: GAUSSIAN.0,
        last: GAUSSIAN.1,
        ..PLAIN
    },
    Layout {
        name: "omnisafe (off-policy)",
        body: &["pi.net"],
        marks: &["obs_normalizer"],
        refusal: Some(
            "the SAC of omnisafe gives means and deviations side by side, its DDPG and TD3 controls alone, and the \
             file does not say which it is; --network pi.net imports all of the outputs, without the statistics of \
             the observations",
        ),
        ..PLAIN
    },
    Layout {
        name: "safe-control-gym (PPO)",
        body: &["actor.pi_net.fcs"],
        marks: &["actor.logstd"],
        beside: &["reward_normalizer"],
        hidden: GAUSSIAN.0,
        last: GAUSSIAN.1,
        ..PLAIN
    },
    Layout {
        name: "safe-control-gym (SAC)",
        body: &["actor.net.fcs", "actor.mu_layer"],
        marks: &["actor.log_std_layer"],
        beside: &["reward_normalizer"],
        beyond: LIMITS,
        ..PLAIN
    },
    Layout {
        name: "Spinning Up (SAC)",
        body: &["pi.net", "pi.mu_layer"],
        marks: &["pi.log_std_layer"],
        beyond: LIMITS,
        ..PLAIN
    },
    Layout {
        name: "Spinning Up (PPO)",
        body: &["pi.mu_net"],
        marks: &["pi.log_std"],
        hidden: GAUSSIAN.0,
        last: GAUSSIAN.1,
        ..PLAIN
    },
    Layout {
        name: "tianshou",
        body: &["actor.preprocess.model.model", "actor.mu.model"],
        marks: &["actor.sigma_param|actor.sigma"],
        beyond: LIMITS,
        ..PLAIN
    },
    Layout {
        name: "tianshou",
        body: &["preprocess.model.model", "mu.model"],
        marks: &["sigma_param|sigma"],
        beyond: LIMITS,
        ..PLAIN
    },
    Layout {
        name: "tianshou",
        body: &["actor.preprocess.model.model", "actor.last.model"],
        marks: &["critic|critic1"],
        beyond: LIMITS,
        ..PLAIN
    },
    Layout {
        name: "pytorch_sac",
        body: &["actor.trunk"],
        marks: &["critic.Q1"],
        doubled: true,
        ..PLAIN
    },
    Layout {
        name: "pytorch_sac",
        body: &["trunk"],
        marks: &["outputs.mu"],
        doubled: true,
        ..PLAIN
    },
];

/// A layout that a file has.
#[derive(Debug)]
pub(super) struct Recognised<'a> {
    pub(super) layout: &'static Layout,
    /// What stands before all of its names.
    pub(super) outer: String,
    /// Its layers.
    pub(super) layers: Vec<Dense<'a>>,
}

/// The layout of a file, if it has one, and has it once.
pub(super) fn recognise<'a>(source: &Source<'_>, layers: &[Dense<'a>]) -> Option<Recognised<'a>> {
    LAYOUTS.iter().find_map(|layout| {
        let last = layout.body.last()?;
        let mut outers: Vec<&str> =
            layers.iter().filter_map(|layer| outer(layer.name, last)).collect();
        outers.dedup();
        let fit = |outer: &&str| fit(layout, outer, source, layers);
        match outers.iter().filter_map(fit).collect::<Vec<_>>() {
            mut one if one.len() == 1 => one.pop(),
            _ => None,
        }
    })
}

/// The layout with what stands before its names, if all of it is there.
fn fit<'a>(
    layout: &'static Layout,
    outer: &str,
    source: &Source<'_>,
    layers: &[Dense<'a>],
) -> Option<Recognised<'a>> {
    let has = |mark: &str| {
        let name = under(outer, mark);
        source.tensors.iter().any(|tensor| starts_with(&tensor.name, &name))
    };
    let marked = layout.marks.iter().all(|marks| marks.split('|').any(has));
    let part = |module: &&str| {
        let module = under(outer, module);
        let own = layers.iter().filter(|layer| is_of(layer.name, &module));
        Some(in_order(own.copied().collect())).filter(|layers| !layers.is_empty())
    };
    let parts: Option<Vec<Vec<Dense<'a>>>> = layout.body.iter().map(part).collect();
    let layers = parts.filter(|_| marked)?.concat();
    Some(Recognised { layout, outer: outer.to_owned(), layers })
}

/// What stands before the module in the name of one of its layers.
fn outer<'a>(layer: &'a str, module: &str) -> Option<&'a str> {
    match module.ends_with('_') {
        true => around(layer.trim_end_matches(|c: char| c.is_ascii_digit()), module)
            .map(|(outer, _)| outer),
        false => around(layer, module).map(|(outer, _)| outer),
    }
}

/// Whether the layer is the module itself, or one of those that it counts.
fn is_of(layer: &str, module: &str) -> bool {
    let (outer, key) = split(layer);
    let counted = |rest: &str| rest.parse::<u32>().is_ok();
    let stem = module.ends_with('_').then(|| layer.strip_prefix(module)).flatten();
    layer == module || (outer == module && counted(key)) || stem.is_some_and(counted)
}
