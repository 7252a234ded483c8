//! Networks that rollouts run themselves, in workgroup memory: which are, and what they take.

use super::attempt::MAX_TRIPS;
use super::compose::{Form, Fused};
use super::listing::{Adapter, AdapterKind};
use crate::error::{Error, Result};
use crate::policy::Mlp;

/// Widest network that rollouts run themselves: beyond, its activations leave no room for a second
/// workgroup, and its parameters do not stay in the caches.
const FUSED_WIDTH: usize = 128;
/// Largest batch that gives each trajectory a workgroup: a few workgroups per multiprocessor.
const SMALL: u32 = 512;
/// Largest batch that leaves a device with tiles of 64 trajectories mostly idle.
const MEDIUM: u32 = 16_384;

/// How rollouts run the network that drives them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum NetworkKernels {
    /// Fused where that should be faster: networks of at most 128 neurons per layer, on hardware
    /// whose workgroups have the memory. Nothing of a trajectory then leaves its workgroup before
    /// the last step, and there is one dispatch instead of one per layer and step. A software
    /// adapter gets layers: workgroup memory is ordinary memory there, and the larger number of
    /// barriers costs.
    #[default]
    Chosen,
    /// A dispatch per layer and step, activations in storage.
    Layered,
    /// The rollout kernel runs all layers of all steps, in the form that fits the size of the batch.
    Fused,
    /// The same in one form for batches of any size.
    Form(Form),
}

/// The forms in which rollouts run a network themselves, from small batches to large ones; none where it
/// has a dispatch per layer.
#[derive(Debug)]
pub(super) struct Forms(Vec<Sized>);

/// A form for batches up to a size.
#[derive(Debug)]
struct Sized {
    /// Most columns of a chunk.
    columns: u32,
    fused: Fused,
}

impl Forms {
    /// Those of `network` on `adapter`.
    ///
    /// # Errors
    /// [`Error::Device`] if they are asked for and not possible.
    pub(super) fn new(
        adapter: &Adapter,
        network: Option<&Mlp>,
        wanted: NetworkKernels,
    ) -> Result<Self> {
        let layered = wanted == NetworkKernels::Layered
            || (wanted == NetworkKernels::Chosen && adapter.kind == AdapterKind::Software);
        let Some(mlp) = network.filter(|_| !layered) else { return Ok(Self(Vec::new())) };
        let candidates = match wanted {
            NetworkKernels::Form(form) => vec![(u32::MAX, vec![form])],
            _ => candidates(),
        };
        let mut forms = Vec::new();
        for (columns, choices) in candidates {
            let mut possible = choices.into_iter().filter_map(|form| fitting(adapter, mlp, form));
            forms.extend(possible.next().map(|fused| Sized { columns, fused }));
        }
        // Without a form for large batches, those for small ones are none.
        let whole = forms.last().is_some_and(|last| last.columns == u32::MAX);
        match (whole, wanted) {
            (true, _) => Ok(Self(forms)),
            (false, NetworkKernels::Chosen) => Ok(Self(Vec::new())),
            (false, NetworkKernels::Form(form)) => Err(Error::Device(format!(
                "a network of the widths {:?} does not have the form {form:?} on {}",
                mlp.widths(),
                adapter.name
            ))),
            (false, _) => Err(does_not_fuse(adapter, mlp)),
        }
    }

    /// The one for batches of `columns` columns.
    pub(super) fn of(&self, columns: u32) -> Option<&Fused> {
        self.0.iter().find(|sized| columns <= sized.columns).map(|sized| &sized.fused)
    }

    /// The one for large batches.
    pub(super) fn largest(&self) -> Option<Fused> {
        self.0.last().map(|sized| sized.fused.clone())
    }
}

/// Forms by the largest batch that they are for, each with those that stand in where a network does not
/// have it. The sizes lie between those at which texts of these forms by themselves were the fastest of
/// many on an H200: 158, 4,096 and 65,536 trajectories.
fn candidates() -> Vec<(u32, Vec<Form>)> {
    let tiles = |trajectories, neurons, columns| Form::Tiles { trajectories, neurons, columns };
    let rows = |trajectories| Form::Rows { trajectories };
    let slices = |trajectories| Form::Slices { trajectories };
    vec![
        (SMALL, vec![rows(1), tiles(8, 4, 4)]),
        (MEDIUM, vec![rows(8), tiles(16, 4, 4)]),
        (u32::MAX, vec![slices(64), slices(32), tiles(64, 8, 8), tiles(32, 8, 8), tiles(16, 4, 4)]),
    ]
}

/// `mlp` in a form, if its workgroups fit on `adapter`.
fn fitting(adapter: &Adapter, mlp: &Mlp, form: Form) -> Option<Fused> {
    let widest = mlp.widths().into_iter().max().unwrap_or(0);
    Fused::new(mlp, form).filter(|fused| {
        widest <= FUSED_WIDTH
            && fused.workgroup_bytes() <= u64::from(adapter.max_workgroup_bytes)
            && fused.lanes() <= adapter.max_workgroup_threads
            && step_trips(fused, 2) <= MAX_TRIPS
    })
}

/// The refusal of `mlp` inside of rollouts on `adapter`.
fn does_not_fuse(adapter: &Adapter, mlp: &Mlp) -> Error {
    Error::Device(format!(
        "the network does not fuse: {}; run it in layers",
        obstacle(adapter, mlp)
    ))
}

/// Why `mlp` does not run inside of rollouts on `adapter`.
fn obstacle(adapter: &Adapter, mlp: &Mlp) -> String {
    if mlp.has_norm() {
        return "a norm behind a layer needs all sums of the layer at once".to_owned();
    }
    let widest = mlp.widths().into_iter().max().unwrap_or(0);
    format!(
        "it has {widest} neurons per layer, at most {FUSED_WIDTH} do, and {} has {} bytes of workgroup memory and \
         {} threads in a workgroup",
        adapter.name, adapter.max_workgroup_bytes, adapter.max_workgroup_threads
    )
}

/// How rollouts on `adapter` run `network`, in words.
///
/// # Errors
/// Those of [`Forms::new`].
pub(super) fn words(adapter: &Adapter, network: &Mlp, wanted: NetworkKernels) -> Result<String> {
    if !Forms::new(adapter, Some(network), wanted)?.0.is_empty() {
        return Ok("fused: rollouts run the network themselves".to_owned());
    }
    let fits = Forms::new(adapter, Some(network), NetworkKernels::Fused).is_ok();
    let reason = match (fits, wanted) {
        (false, _) => obstacle(adapter, network),
        (true, NetworkKernels::Layered) => "as asked for".to_owned(),
        (true, _) => "which a software adapter does faster".to_owned(),
    };
    Ok(format!("in layers, a dispatch for each of a step: {reason}"))
}

/// Loop iterations of a thread for one step of `sides` trajectories that runs the network itself.
pub(super) fn step_trips(fused: &Fused, sides: u32) -> u64 {
    1 + u64::from(sides) * fused.trips()
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::policy::{Activation, Layer};

    /// A network of these widths, all of it 0.
    pub(in crate::backend::gpu) fn network(widths: &[usize]) -> Mlp {
        let layer = |pair: &[usize]| Layer::dense(vec![0.0; pair[0] * pair[1]], vec![0.0; pair[1]]);
        let layers = widths.windows(2).map(layer).collect();
        Mlp::new(layers, Activation::Relu, Activation::Tanh).expect("a whole network")
    }

    /// The forms of a network of these widths on an adapter with `bytes` of workgroup memory, each with
    /// the largest batch that it is for.
    fn forms(
        widths: &[usize],
        bytes: u32,
        kind: AdapterKind,
        wanted: NetworkKernels,
    ) -> Vec<(u32, Form)> {
        let adapter = Adapter { kind, max_workgroup_bytes: bytes, ..Adapter::made_up(1 << 27) };
        let forms = Forms::new(&adapter, Some(&network(widths)), wanted);
        let all = forms.map(|forms| forms.0).unwrap_or_default();
        all.iter().map(|sized| (sized.columns, sized.fused.form())).collect()
    }

    #[test]
    fn networks_fuse_where_they_fit() {
        use AdapterKind::{Discrete, Software};
        use NetworkKernels::{Chosen, Layered};
        let (least, usual) = (16 << 10, 32 << 10);
        let fuses =
            |widths: &[usize], bytes, kind, wanted| !forms(widths, bytes, kind, wanted).is_empty();
        assert!(fuses(&[12, 64, 64, 64, 3], least, Discrete, Chosen));
        assert!(fuses(&[12, 128, 128, 3], usual, Discrete, Chosen));
        assert!(!fuses(&[12, 129, 3], 1 << 20, Discrete, Chosen), "too wide");
        assert!(!fuses(&[12, 129, 3], 1 << 20, Discrete, NetworkKernels::Fused), "too wide");
        assert!(!fuses(&[12, 64, 3], usual, Software, Chosen));
        assert!(fuses(&[12, 64, 3], usual, Software, NetworkKernels::Fused));
        assert!(!fuses(&[12, 64, 3], usual, Discrete, Layered));
    }

    #[test]
    fn how_a_network_runs_is_said_with_the_reason() {
        use NetworkKernels::{Chosen, Fused, Layered};
        let said = |network: &Mlp, kind, wanted| {
            words(&Adapter { kind, ..Adapter::made_up(1 << 27) }, network, wanted)
                .unwrap_or_default()
        };
        let (narrow, wide) = (network(&[12, 64, 3]), network(&[12, 200, 3]));
        let hardware = AdapterKind::Discrete;
        assert!(said(&narrow, hardware, Chosen).starts_with("fused"));
        assert!(said(&narrow, AdapterKind::Software, Fused).starts_with("fused"));
        assert!(
            said(&narrow, AdapterKind::Software, Chosen).ends_with("software adapter does faster")
        );
        assert!(said(&narrow, hardware, Layered).ends_with("as asked for"));
        assert!(said(&wide, hardware, Chosen).contains("200 neurons per layer"));
    }

    #[test]
    fn forms_follow_sizes_widths_and_memory() {
        let chosen = |widths: &[usize], bytes| {
            forms(widths, bytes, AdapterKind::Discrete, NetworkKernels::Chosen)
        };
        let tiles = |trajectories, neurons, columns| Form::Tiles { trajectories, neurons, columns };
        let slices = |trajectories| Form::Slices { trajectories };
        let rows = |trajectories| Form::Rows { trajectories };
        let [small, medium, large] = [SMALL, MEDIUM, u32::MAX];
        assert_eq!(
            chosen(&[12, 64, 64, 64, 3], 32 << 10),
            [(small, rows(1)), (medium, rows(8)), (large, slices(64))]
        );
        assert_eq!(
            chosen(&[12, 128, 128, 128, 3], 32 << 10),
            [(small, tiles(8, 4, 4)), (medium, tiles(16, 4, 4)), (large, slices(32))],
            "too many weights to keep, too much memory for 64 trajectories"
        );
        assert_eq!(chosen(&[12, 64, 64, 3], 16 << 10)[2], (large, slices(32)));
        assert_eq!(chosen(&[12, 64, 32, 3], 32 << 10)[2], (large, tiles(64, 8, 8)), "two widths");
        assert_eq!(chosen(&[12, 16, 3], 32 << 10)[2], (large, tiles(64, 8, 8)), "narrow");
        assert_eq!(chosen(&[3, 2], 32 << 10)[0], (small, tiles(8, 4, 4)), "no hidden layer");
    }
}
