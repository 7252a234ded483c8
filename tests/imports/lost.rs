//! What would be lost is refused, unless the layers are asked for by name, and then it is named.

use reachcast::policy::Activation;
use reachcast::policy::import::Request;

use super::{imported, named, refusal};
use crate::checkpoint::stated;

#[test]
fn recurrences_are_refused_unless_the_dense_layers_are_asked_for() {
    let words = ["recurrent", "`memory.weight_ih_l0`", "--network actor", "another policy"];
    refusal("recurrent.pth", &Request::default(), &words);
    let found = imported("recurrent.pth", &named(&["actor"]));
    let memory =
        ["memory.weight_ih_l0", "memory.weight_hh_l0", "memory.bias_ih_l0", "memory.bias_hh_l0"];
    assert_eq!(found.left_out, memory);
}

#[test]
fn heads_are_named() {
    refusal("heads.onnx", &Request::default(), &["`action, value`", "--network"]);
    refusal("heads.onnx", &named(&["policy"]), &["no output `policy`", "action, value"]);
    let found = imported("heads.onnx", &named(&["action"]));
    assert_eq!(found.left_out, ["v.weight", "v.bias", "value"]);
    let body = Request { output: Some(Activation::Tanh), ..named(&["mlp_extractor.policy_net"]) };
    let body = imported("sb3_ppo.zip", &Request { activation: body.output, ..body });
    assert!(body.left_out.contains(&"action_net.weight".to_owned()), "{:?}", body.left_out);
}

#[test]
fn what_is_left_out_is_named_one_by_one() {
    let left_out = |name: &str| imported(name, &stated()).left_out;
    let lightning = left_out("lightning.ckpt");
    let callback = "callbacks.best (pytorch_lightning.callbacks.model_checkpoint.ModelCheckpoint)";
    assert!(lightning.contains(&callback.to_owned()), "{lightning:?}");
    let rsl_rl = left_out("rsl_rl.pt");
    for name in [
        "model_state_dict.std",
        "model_state_dict.critic.0.weight",
        "model_state_dict.actor_obs_normalizer._var",
        "optimizer_state_dict.state.0.exp_avg",
    ] {
        assert!(rsl_rl.contains(&name.to_owned()), "no {name} in {rsl_rl:?}");
    }
    let named = imported("omnisafe.pt", &named(&["pi.mean"])).left_out;
    assert!(named.contains(&"obs_normalizer._mean".to_owned()), "{named:?}");
}
