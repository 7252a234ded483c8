//! Archives of stable-baselines3: the checkpoint in one, and what its `data` says in plain JSON.
//!
//! `data` also holds pickled objects, as texts; they are never looked at.

use serde_json::Value;

use super::archive::Entries;
use super::format::OWN_ARRAYS;
use super::map::Map;
use super::request::Hints;
use crate::policy::Activation;

/// Longest `data`, bytes.
const LONGEST: usize = 1 << 26;

/// A model.
#[derive(Debug)]
pub(super) struct Model {
    /// The content of `policy.pth`.
    pub(super) checkpoint: Vec<u8>,
    /// What `data` says about it.
    pub(super) hints: Hints,
}

/// The model in an archive without a pickle of its own.
///
/// # Errors
/// A sentence about an archive of another program, with what lies in it, or about damage.
pub(super) fn open(mut entries: Entries<'_>) -> Result<Model, String> {
    if !entries.has("policy.pth") {
        return Err(other(entries.names()));
    }
    let hints = match entries.has("data") {
        true => hints(&entries.read("data")?)?,
        false => Hints::default(),
    };
    Ok(Model { checkpoint: entries.read("policy.pth")?, hints })
}

/// The refusal of an archive that is no model's.
fn other(names: &[String]) -> String {
    let all = |ending: &str| !names.is_empty() && names.iter().all(|name| name.ends_with(ending));
    let has = |name: &str| names.iter().any(|entry| entry == name);
    if all(".npy") && has("layers.0.weight.npy") {
        return OWN_ARRAYS.to_owned();
    }
    if all(".npy") {
        return "NumPy arrays (.npz); save them as safetensors: \
                safetensors.numpy.save_file(dict(numpy.load(FILE)), 'policy.safetensors'), with the weights [out, in] under \
                names like `0.weight`, or [in, out] under `0.kernel`, and biases under `0.bias`"
            .to_owned();
    }
    if has("config.json") && has("model.weights.h5") {
        return "a model of Keras; convert it to ONNX: keras.saving.load_model(FILE).export('policy.onnx', format='onnx')"
            .to_owned();
    }
    let shown: Vec<&str> = names.iter().take(6).map(String::as_str).collect();
    format!(
        "no entry `data.pkl`: not written by torch.save; and none `policy.pth`, as stable-baselines3 has it. It \
         holds: {}",
        shown.join(", ")
    )
}

/// What `data` says.
fn hints(data: &[u8]) -> Result<Hints, String> {
    if data.len() > LONGEST {
        return Err(format!("entry `data`: {} bytes of JSON", data.len()));
    }
    let data: Value =
        serde_json::from_slice(data).map_err(|e| format!("entry `data`: no JSON ({e})"))?;
    let kwargs = &data["policy_kwargs"];
    let mut hints = Hints::default();
    match activation(kwargs) {
        Ok(known) => hints.activation = known,
        Err(unsaid) => hints.unsaid = Some(unsaid),
    }
    hints.clip = number(&kwargs["clip_mean"])?;
    hints.refusal = own_classes(&data);
    // With exploration that depends on the state, PPO may bound its actions as SAC does.
    let squashed =
        kwargs["squash_output"] == Value::Bool(true) || kwargs["squash_output"] == "True";
    if squashed {
        hints.output = Some(Activation::Tanh);
    }
    let is_off_policy = data.get("replay_buffer_class").is_some();
    actions(&data["action_space"], squashed || is_off_policy, &mut hints);
    Ok(hints)
}

/// A number, or its text; none if there is none.
fn number(value: &Value) -> Result<Option<f64>, String> {
    let number = match value {
        Value::Null => return Ok(None),
        Value::String(text) => text.trim().parse().ok(),
        other => other.as_f64(),
    };
    let positive = number.filter(|number| number.is_finite() && *number > 0.0);
    let problem = || format!("`data` has the clip_mean {value}, which is no number above 0");
    positive.map(Some).ok_or_else(problem)
}

/// The refusal of a model with a class of its own, which may do anything with observations and actions.
fn own_classes(data: &Value) -> Option<String> {
    let extractor = data["policy_kwargs"]["features_extractor_class"].as_str();
    let extractor = extractor.filter(|class| !class.ends_with("torch_layers.FlattenExtractor'>"));
    let module = data["policy_class"]["__module__"].as_str();
    let module = module.filter(|module| {
        !["stable_baselines3", "sb3_contrib"]
            .contains(&module.split('.').next().unwrap_or_default())
    });
    let (what, class) = match (extractor, module) {
        (Some(class), _) => ("features_extractor_class", class),
        (_, Some(class)) => ("policy_class", class),
        _ => return None,
    };
    Some(format!(
        "`data` has the {what} `{class}`, whose code is not in plain words: what it does with the observations would be \
         lost; --network imports the layers alone, or export the model to ONNX with it"
    ))
}

/// The activation between the layers, where the model was given one.
fn activation(kwargs: &Value) -> Result<Option<Activation>, String> {
    let Some(class) = kwargs["activation_fn"].as_str() else { return Ok(None) };
    let name = class.trim_end_matches("'>").rsplit('.').next().unwrap_or_default();
    Ok(Some(match name {
        "ReLU" => Activation::Relu,
        "Tanh" => Activation::Tanh,
        "ELU" => Activation::Elu { alpha: 1.0 },
        "SELU" => Activation::Selu,
        "CELU" => Activation::Celu { alpha: 1.0 },
        "GELU" => Activation::Gelu,
        "SiLU" => Activation::Silu,
        "Mish" => Activation::Mish,
        "LeakyReLU" => Activation::LeakyRelu { slope: 0.01 },
        "Sigmoid" => Activation::Sigmoid,
        "Softplus" => Activation::Softplus { beta: 1.0 },
        "Softsign" => Activation::Softsign,
        "Hardtanh" => Activation::Hardtanh { low: -1.0, high: 1.0 },
        "ReLU6" => Activation::Relu6,
        "Identity" => Activation::Identity,
        _ => {
            return Err(format!(
                "`data` has the activation `{class}`, which is none that is known: --activation states which it is, one of {}",
                Activation::words()
            ));
        }
    }))
}

/// What the model does with its output: within the limits of the actions, or scaled to them.
fn actions(space: &Value, squashed: bool, hints: &mut Hints) {
    let class = space[":type:"].as_str().unwrap_or_default();
    if class.contains("Discrete") || class.contains("MultiBinary") {
        hints.refusal = Some(format!(
            "its actions are `{class}`, chosen by the largest output; a policy here gives numbers. --network imports \
             the layers alone"
        ));
        return;
    }
    let what = if squashed {
        "scaled to the limits of the actions"
    } else {
        "kept within the limits of the actions"
    };
    let Some([low, high]) = limits(space) else {
        hints.notes.push(format!(
            "not in it: predict() gives the output {what}, which `data` does not say in plain words"
        ));
        return;
    };
    let map = match squashed {
        true => {
            let half =
                |sign: f64| low.iter().zip(&high).map(move |(low, high)| (high + sign * low) / 2.0);
            Map::affine(half(-1.0).collect(), half(1.0).collect())
        }
        false => Map::clamp(low.clone(), high.clone()),
    };
    if !map.is_identity() {
        hints.notes.push(format!("the output is {what}, {low:?} to {high:?}, as predict() does"));
        hints.output_map = Some(map);
    }
}

/// The limits of actions, where the texts of both are lists of finite numbers.
fn limits(space: &Value) -> Option<[Vec<f64>; 2]> {
    let numbers = |key: &str| -> Option<Vec<f64>> {
        let text = space[key].as_str()?.trim();
        let inside = text.strip_prefix('[').and_then(|text| text.strip_suffix(']')).unwrap_or(text);
        let numbers: Option<Vec<f64>> =
            inside.split_whitespace().map(|word| word.parse().ok()).collect();
        numbers.filter(|numbers| !numbers.is_empty())
    };
    let [low, high] = [numbers("low")?, numbers("high")?];
    let ordered = low.len() == high.len() && low.iter().zip(&high).all(|(low, high)| low < high);
    let finite = low.iter().chain(&high).all(|limit| limit.is_finite());
    (ordered && finite).then_some([low, high])
}
