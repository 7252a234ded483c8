//! The last layer: each trajectory's own thread, since it has few neurons.

use super::form::Form;
use super::network::Fused;
use super::rows;

/// Lines that compute the outputs `v0`, `v1`, ... of the trajectory of `lane`, in vectors of 4.
pub(super) fn text(fused: &Fused) -> String {
    let layer = fused.last();
    let quads = layer.neurons.div_ceil(4);
    let weights = layer.offset + layer.quads;
    let mut text = String::new();
    for quad in 0..quads {
        text += &format!("    var s{quad} = weights[{}u];\n", layer.offset + quad);
    }
    text += &format!("    for (var k = 0u; k < {}u; k += 4u) {{\n", layer.depth);
    text += &format!("        let h = {};\n", inputs(fused));
    for (entry, part) in ["x", "y", "z", "w"].into_iter().enumerate() {
        for quad in 0..quads {
            let at = format!("{}u + (k + {entry}u) * {}u", weights + quad, layer.quads);
            text +=
                &format!("        s{quad} = fma(weights[{at}], vec4<f32>(h.{part}), s{quad});\n");
        }
    }
    text += "    }\n";
    for quad in 0..quads {
        let activated =
            ["x", "y", "z", "w"].map(|part| format!("output_activation(s{quad}.{part})"));
        text += &format!("    let v{quad} = vec4<f32>({});\n", activated.join(", "));
    }
    text
}

/// The vector of the inputs from `k` on.
fn inputs(fused: &Fused) -> String {
    match fused.form() {
        Form::Rows { .. } => {
            let name = rows::buffer(fused.hidden().len());
            format!("{name}[lane * INPUT_QUADS + k / 4u]")
        }
        _ => {
            let entry =
                |i: u32| format!("activations[(k + {i}u) * COLUMN_QUADS + lane / 4u][lane % 4u]");
            format!("vec4<f32>({})", [0, 1, 2, 3].map(entry).join(", "))
        }
    }
}
