//! Archives of stable-baselines3: the checkpoint in one, and what its `data` says in plain JSON.
//!
//! `data` also holds pickled objects, as texts; of one the numbers are read, and none is made.

use serde_json::Value;

use super::archive::Entries;
use super::format::OWN_ARRAYS;
use super::map::Map;
use super::request::Hints;
use super::said;
use super::spaces;
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
                safetensors.numpy.save_file({k: a.astype('f4') for k, a in numpy.load(FILE).items()}, 'policy.safetensors'), with the weights [out, in] under \
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
    hints.is_said = data["action_space"].is_object();
    hints.clip = number(&kwargs["clip_mean"])?;
    if let Some((what, class)) = own_class(&data) {
        hints.around.push(format!("what the {what} `{class}` does"));
        hints.refusal = Some(format!(
            "`data` has the {what} `{class}`, whose code is not in plain words: what it does with the observations would \
             be lost; --network imports the layers alone, or export the model to ONNX with it"
        ));
    }
    observations(&data, &mut hints);
    // With exploration that depends on the state, PPO may bound its actions as SAC does.
    let squashed =
        kwargs["squash_output"] == Value::Bool(true) || kwargs["squash_output"] == "True";
    if squashed {
        hints.output = Some(Activation::Tanh);
    }
    let is_off_policy = data.get("replay_buffer_class").is_some();
    if hints.is_said {
        actions(&data["action_space"], squashed || is_off_policy, &mut hints);
    }
    Ok(hints)
}

/// A number, or its text; none if there is none.
fn number(value: &Value) -> Result<Option<f64>, String> {
    let number = match value {
        Value::Null => return Ok(None),
        Value::String(text) => text.trim().parse().ok(),
        other => other.as_f64(),
    };
    let finite = number.filter(|number| number.is_finite());
    let problem = || format!("`data` has the clip_mean {value}, which is no finite number");
    finite.map(Some).ok_or_else(problem)
}

/// A class of the model's own, which may do anything with observations and actions: under which key, and its name.
fn own_class(data: &Value) -> Option<(&'static str, String)> {
    let extractor = data["policy_kwargs"]["features_extractor_class"].as_str();
    let extractor = extractor.filter(|class| !class.ends_with("torch_layers.FlattenExtractor'>"));
    if let Some(class) = extractor {
        return Some(("features_extractor_class", class.to_owned()));
    }
    let module = data["policy_class"]["__module__"].as_str()?;
    let library = module.split('.').next().unwrap_or_default();
    let own = !["stable_baselines3", "sb3_contrib"].contains(&library);
    own.then(|| ("policy_class of the module", module.to_owned()))
}

/// The activation between the layers, where the model was given one.
fn activation(kwargs: &Value) -> Result<Option<Activation>, String> {
    let Some(class) = kwargs["activation_fn"].as_str() else { return Ok(None) };
    let problem = || {
        format!(
            "`data` has the activation `{class}`, which is none that is known: --activation states which it is, one of {}",
            Activation::words()
        )
    };
    said::activation(class).map(Some).ok_or_else(problem)
}

/// What the model does with observations before its layers: images are divided, choices are written out, and parts joined.
fn observations(data: &Value, hints: &mut Hints) {
    let space = &data["observation_space"];
    let class = space[":type:"].as_str().unwrap_or_default();
    let said = |key: &str| space[key].as_str().unwrap_or_default();
    let kind = class.trim_end_matches("'>").rsplit('.').next().unwrap_or_default();
    match kind {
        "Box" if is_image(data) => {
            hints.around.push("the division of the observations by 255".to_owned());
            hints.refusal = Some(format!(
                "its observations are images of shape {} with numbers from 0 to 255, which predict() divides by 255, and \
                 whose channels it may put first; export the model to ONNX with that, or --network imports the layers alone",
                space["_shape"]
            ));
        }
        "Discrete" => hints.notes.push(format!(
            "the observation is one of {} choices: the inputs are 1 at the chosen one and 0 at the others",
            said("n")
        )),
        "MultiDiscrete" => hints.notes.push(format!(
            "the observations are choices of {}: the inputs are, for one after the other, 1 at the chosen one and 0 at \
             the others",
            said("nvec")
        )),
        "Dict" => hints.notes.push(format!(
            "the observations are a dictionary: the inputs are its parts one after the other, in the order of {}",
            said("spaces")
        )),
        _ => {}
    }
}

/// Whether the library divides the observations by 255: three dimensions of bytes that go from 0 to 255.
fn is_image(data: &Value) -> bool {
    let space = &data["observation_space"];
    let all = |key: &str, wanted: &str| {
        let text = space[key].as_str().unwrap_or_default();
        let mut words = text.split(|c: char| !c.is_ascii_digit()).filter(|word| !word.is_empty());
        words.all(|word| word == wanted)
    };
    space["dtype"].as_str().is_some_and(|dtype| dtype.contains("uint8"))
        && space["_shape"].as_array().is_some_and(|shape| shape.len() == 3)
        && data["policy_kwargs"]["normalize_images"] != Value::Bool(false)
        && all("low", "0")
        && all("high", "255")
}

/// What the model does with its output: within the limits of the actions, or scaled to them.
fn actions(space: &Value, squashed: bool, hints: &mut Hints) {
    let class = space[":type:"].as_str().unwrap_or_default();
    if class.contains("Discrete") || class.contains("MultiBinary") {
        hints.around.push("the choice of an action by the largest output".to_owned());
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
        let unsaid =
            format!("predict() gives the output {what}, which `data` does not say in plain words");
        match squashed {
            true => {
                hints.around.push(unsaid.clone());
                hints.refusal = Some(format!(
                    "{unsaid}; --network imports the layers alone, whose output is not scaled"
                ));
            }
            false => hints.notes.push(format!("not in it: {unsaid}")),
        }
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
        hints.around.push(format!("the output is {what}, {low:?} to {high:?}, as predict() does"));
    }
    // Limits of another count than the outputs are refused there.
    hints.output_map = Some(map).filter(|map| map.width() > 1 || !map.is_identity());
}

/// The limits of actions, finite numbers and as many as their shape says: of the space as it was pickled, since texts
/// have as many digits as NumPy was asked to print, or else of these.
fn limits(space: &Value) -> Option<[Vec<f64>; 2]> {
    let lengths: Option<Vec<u64>> =
        space["_shape"].as_array().map(|all| all.iter().filter_map(Value::as_u64).collect());
    let product = |all: Vec<u64>| all.iter().try_fold(1_u64, |n, length| n.checked_mul(*length));
    let count = lengths.map(|all| product(all).unwrap_or(u64::MAX));
    let pickled = space[":serialized:"].as_str().and_then(spaces::limits);
    let numbers = |key: &str| -> Option<Vec<f64>> {
        let words = space[key].as_str()?.split(|c: char| c.is_whitespace() || "[]".contains(c));
        let words = words.filter(|word| !word.is_empty());
        let numbers: Vec<f64> = words.map(|word| word.parse().ok()).collect::<Option<_>>()?;
        let fits = count.is_none_or(|count| count == numbers.len() as u64);
        Some(numbers).filter(|numbers| fits && !numbers.is_empty())
    };
    let [low, high] = match pickled {
        Some([low, high]) if count.is_none_or(|count| count == low.len() as u64) => [low, high],
        _ => [numbers("low")?, numbers("high")?],
    };
    let ordered = low.len() == high.len() && low.iter().zip(&high).all(|(low, high)| low < high);
    let finite = low.iter().chain(&high).all(|limit| limit.is_finite());
    (ordered && finite).then_some([low, high])
}
