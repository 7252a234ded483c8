//! What the words beside the tensors of a file say: numbers, and activations.

use super::bearing::judges;
use super::source::{Amount, Said, Source};
use crate::policy::Activation;

/// Other words for activations.
const OTHERS: [(&str, Activation); 4] = [
    ("swish", Activation::Silu),
    ("linear", Activation::Identity),
    ("none", Activation::Identity),
    ("lrelu", Activation::LeakyRelu { slope: 0.01 }),
];
/// Where the activations of libraries lie.
const MODULES: [&str; 13] = [
    "",
    "nn",
    "F",
    "nn.functional",
    "torch",
    "torch.nn",
    "torch.nn.functional",
    "torch.nn.modules.activation",
    "torch.nn.modules.linear",
    "jax.nn",
    "flax.linen",
    "tf.nn",
    "keras.activations",
];
/// What the keys of activations end in.
const NAMES: [&str; 7] = [
    "activation",
    "activation_fn",
    "activation_function",
    "act",
    "act_fn",
    "nonlinearity",
    "non_linearity",
];
/// What the keys of the last activation have in them.
const LAST: [&str; 7] = ["out", "last", "final", "squash", "head", "mu_", "mean_"];

/// How many numbers a text is: one, or a list of them in brackets or without; none if it is words.
pub(super) fn amount(text: &str) -> Option<Amount> {
    let inside = text.trim().trim_start_matches(['[', '(']).trim_end_matches([']', ')']);
    let words = inside.split(|c: char| c == ',' || c.is_whitespace()).filter(|w| !w.is_empty());
    let words: Vec<&str> = words.collect();
    let numbers = !words.is_empty() && words.iter().all(|word| word.parse::<f64>().is_ok());
    numbers.then(|| Amount::of(words.len()))
}

/// The activation that a word or a class of a known library stands for: `elu`, `swish`, `<class 'torch.nn.ReLU'>`.
pub(super) fn activation(text: &str) -> Option<Activation> {
    let text = text.trim_start_matches("<class '").trim_end_matches("'>").trim_end_matches("()");
    let (module, name) = text.rsplit_once('.').unwrap_or(("", text));
    let plain = |word: &str| word.trim().to_lowercase().replace(['_', '-', ' '], "");
    let word = plain(name);
    let known = Activation::ALL.into_iter().find(|kind| plain(&bare(kind.name())) == word);
    let other = OTHERS.iter().find(|(other, _)| *other == word).map(|(_, kind)| *kind);
    known.or(other).filter(|_| MODULES.contains(&module))
}

/// The word of an activation without its parameters.
fn bare(name: String) -> String {
    name.split('(').next().unwrap_or_default().to_owned()
}

/// What stands between the layers of a policy, or behind the last one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Used {
    pub(super) activation: Activation,
    /// Whether it was asked for.
    pub(super) is_stated: bool,
}

/// Refuses words of the file that name another activation than is used, unless that was asked for.
///
/// # Errors
/// The refusal, with the words.
pub(super) fn check(source: &Source<'_>, hidden: Used, last: Used) -> Result<(), String> {
    for Said { name, text } in &source.said {
        let (before, key) = name.rsplit_once('.').unwrap_or(("", name));
        let names_one = NAMES.iter().any(|end| key == *end || key.ends_with(&format!("_{end}")));
        if !names_one || before.split('.').chain(key.split('_')).any(judges) {
            continue;
        }
        let is_last = LAST.iter().any(|word| key.contains(word));
        let (used, flag) = if is_last { (last, "output") } else { (hidden, "activation") };
        if !used.is_stated && activation(text) != Some(used.activation) {
            return Err(format!(
                "`{name}` says `{text}`, and `{}` would be used; state which it is: --{flag} with one of {}",
                used.activation.name(),
                Activation::words()
            ));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_numbers_or_activations() {
        assert_eq!(amount("2.0"), Some(Amount::One));
        assert_eq!(amount("[1, 2]"), Some(Amount::Many));
        assert_eq!((amount("2 m"), amount("")), (None, None));
        assert_eq!(
            activation("<class 'torch.nn.modules.activation.ReLU'>"),
            Some(Activation::Relu)
        );
        assert_eq!(activation("LeakyReLU"), Some(Activation::LeakyRelu { slope: 0.01 }));
        assert_eq!(activation("nn.ELU()"), Some(Activation::Elu { alpha: 1.0 }));
        assert_eq!(activation("Swish"), Some(Activation::Silu));
        assert_eq!((activation("PReLU"), activation("")), (None, None));
    }
}
