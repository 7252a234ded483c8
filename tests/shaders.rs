//! Without a GPU: every composed kernel is valid WGSL and agrees with the Rust side.

#[path = "oracle/costs.rs"]
#[allow(dead_code, reason = "the texts alone are looked at")]
mod costs;
mod drivers;
mod learned;
mod models;

use std::sync::Arc;

use bytemuck::Zeroable;
use models::{DRIVERS, VALUES};
use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use naga::{AddressSpace, StorageAccess, TypeInner};
use reachcast::backend::gpu::Params;
use reachcast::backend::gpu::compose::{
    Access, Form, Fused, Kernel, MppiText, PlantText, Slot, limit_kernel,
};
use reachcast::cost::{Cost, CostMap, GoalCost, Grid, Quadratic};
use reachcast::formula::{Expr, Scalar as _, record};
use reachcast::model::{Controller, Law, Lookups, MapCost, Model, StageCost, TerminalCost};
use reachcast::policy::{Activation, Layer, Mlp, Norm, Policy};
use reachcast::race::{Cone, DroneRace, Fence, RaceCost, RecoveryCost, Safety};
use reachcast::real::Real;
use reachcast::rollout::{Disturbance, MppiSettings, MppiSpec, NoiseKind, Planning, ValueTerm};
use reachcast::system::{Axis, BangBang, DiffDrive, DoubleIntegrator, System};

/// One state, one control: the recorded functions take and return plain numbers.
#[derive(Clone)]
struct Scalar;

impl System<1, 1> for Scalar {
    fn name(&self) -> &str {
        "scalar"
    }
    fn states(&self) -> [Axis; 1] {
        [Axis::new("x", "m", -1.0, 1.0)]
    }
    fn controls(&self) -> [Axis; 1] {
        [Axis::new("u", "m", -1.0, 1.0)]
    }
    fn step<R: Real>(&self, [x]: [R; 1], [u]: [R; 1]) -> [R; 1] {
        [x.sin() + u]
    }
    fn target<R: Real>(&self, [x]: [R; 1]) -> R {
        x
    }
    fn constraint<R: Real>(&self, [x]: [R; 1]) -> R {
        x.cos()
    }
}

/// A formula for any system: the control is the first states, clamped.
struct Clamped;

impl<const NX: usize, const NU: usize> Policy<NX, NU> for Clamped {
    fn name(&self) -> String {
        "clamped".to_owned()
    }
    fn control<R: Real>(&self, x: [R; NX]) -> [R; NU] {
        std::array::from_fn(|i| x[i % NX].clamp(R::lit(-1.0), R::lit(1.0)))
    }
}

/// A network with one hidden layer of 5 neurons.
fn network(states: usize, controls: usize, activation: Activation) -> Mlp {
    network_of(states, 5, controls, activation)
}

/// A network with one hidden layer of `hidden` neurons.
fn network_of(states: usize, hidden: usize, controls: usize, activation: Activation) -> Mlp {
    let layer = |inputs: usize, outputs: usize| {
        Layer::dense(vec![0.1; inputs * outputs], vec![0.0; outputs])
    };
    let layers = vec![layer(states, hidden), layer(hidden, controls)];
    Mlp::new(layers, activation, Activation::Tanh).expect("a whole network")
}

/// A network with a norm behind its first layer.
fn normed() -> Controller {
    let mut layers = network(2, 1, Activation::Gelu).layers().to_vec();
    layers[0].norm = Some(Norm { scale: vec![1.0; 5], shift: vec![0.0; 5], epsilon: 1e-5 });
    let mlp = Mlp::from_layers(layers).expect("a whole network");
    Controller::of(&DoubleIntegrator::default(), mlp)
}

/// Forms of networks that rollouts run themselves: of each kind, and tiles of each size.
const FORMS: [Form; 5] = [
    Form::Tiles { trajectories: 8, neurons: 4, columns: 4 },
    Form::Tiles { trajectories: 32, neurons: 8, columns: 8 },
    Form::Slices { trajectories: 32 },
    Form::Rows { trajectories: 1 },
    Form::Rows { trajectories: 8 },
];

/// The kernels of a plant, by name.
type Named = (String, PlantText);

/// A system under a formula, and under a network of each activation in layers and fused.
fn plants<S, const NX: usize, const NU: usize>(system: S) -> Vec<Named>
where
    S: System<NX, NU> + Send + Sync + 'static,
{
    let name = system.name().to_owned();
    let formula = Controller::of(&system, Clamped);
    let activations = [Activation::Relu, Activation::Tanh, Activation::Gelu];
    let networks = activations.map(|activation| network(NX, NU, activation));
    let driven = networks.map(|mlp| Controller::of(&system, mlp));
    let model = Model::of(system);
    let mut all = vec![(format!("{name} clamped"), text(&model, &formula))];
    for (activation, controller) in activations.into_iter().zip(&driven) {
        let (name, text) = (format!("{name} {activation:?}"), text(&model, controller));
        all.push((name.clone(), text.clone()));
        for hidden in [5, 128] {
            for form in FORMS {
                let fused = Fused::new(&network_of(NX, hidden, NU, activation), form);
                let Some(fused) = fused else { continue };
                let name = format!("{name}, {hidden} neurons fused, {form:?}");
                all.push((name, text.clone().fusing(Some(fused))));
            }
        }
    }
    all
}

fn text(model: &Model, controller: &Controller) -> PlantText {
    PlantText::new(model, controller).expect("formulas that fit")
}

/// A model whose formulas read parameters and time, under each kind of driver, with `points` parts of a period.
fn drifts(points: u32) -> Vec<Named> {
    let mut all = Vec::new();
    for driver in DRIVERS {
        let plant = driver.plant(VALUES);
        let mut model = Model::clone(&plant.model);
        model.points = points;
        let text = text(&model, &plant.controller);
        for form in FORMS {
            let fused = plant.controller.network().and_then(|mlp| Fused::new(mlp, form));
            let Some(fused) = fused else { continue };
            let name = format!("drift in {points}, {driver:?} fused, {form:?}");
            all.push((name, text.clone().fusing(Some(fused))));
        }
        all.push((format!("drift in {points}, {driver:?}"), text));
    }
    all
}

/// Every plant that the kernels are composed for here.
fn all_plants() -> Vec<Named> {
    let mut all = plants(Scalar);
    all.extend(plants(DoubleIntegrator::default()));
    all.extend(plants(DiffDrive::default()));
    let integrator = DoubleIntegrator::default();
    let bang = Controller::of(&integrator, BangBang { acceleration: 1.0 });
    all.push(("bang-bang".to_owned(), text(&Model::of(integrator), &bang)));
    for cone in [Cone::Distance, Cone::Squared, Cone::Root] {
        let speed_limit = cone == Cone::Distance;
        all.extend(plants(DroneRace { cone, speed_limit, ..DroneRace::default() }));
    }
    all.extend([1, 3].into_iter().flat_map(drifts));
    for law in learned::LAWS {
        let plant = learned::plant(law);
        all.push((format!("learned cart, {law:?}"), text(&plant.model, &plant.controller)));
    }
    all.push(("learned scalar".to_owned(), learned_scalar()));
    all
}

/// One state and one control, whose next state and margins are a network's.
fn learned_scalar() -> PlantText {
    let network = Arc::new(network(1, 1, Activation::Relu));
    let mut model = Model::of(Scalar);
    let called = |x: &[Expr]| Expr::call(&network, &x[..1]);
    model.step = record(model.inputs(), called);
    model.target = record(model.inputs(), called);
    text(&model, &Controller::of(&Scalar, Clamped))
}

/// Parses and validates; the panic shows the place.
fn validated(name: &str, text: &str) -> (naga::Module, ModuleInfo) {
    let module = naga::front::wgsl::parse_str(text)
        .unwrap_or_else(|e| panic!("{name}:\n{}", e.emit_to_string(text)));
    // No capabilities: what every adapter offers must do.
    let mut validator = Validator::new(ValidationFlags::all(), Capabilities::empty());
    let info = validator
        .validate(&module)
        .unwrap_or_else(|e| panic!("{name}:\n{}", e.emit_to_string(text)));
    (module, info)
}

/// A kernel, the threads of its workgroup, and what it binds.
type Bindings<'a> = (Kernel, u32, &'a [(Slot, Access)]);

/// Texts of MPPI for one system and cost: each kind of noise, with and without each network.
fn mppi_texts_of<S, C, const NX: usize, const NU: usize, const NC: usize>(
    system: &S,
    cost: &C,
    out: &mut Vec<(String, MppiText)>,
) where
    S: System<NX, NU> + Clone + Send + 'static,
    C: Cost<NX, NU, NC> + Clone + Send + 'static,
{
    let value = network(NX, 1, Activation::Tanh);
    let push = network(NX, 1, Activation::Relu);
    let term = ValueTerm { network: Arc::new(value), weight: 1.0, threshold: 0.5 };
    let pushed = Disturbance { network: Arc::new(push), entries: vec![(NX - 1, 0.5)] };
    let kinds =
        [NoiseKind::Independent, NoiseKind::Colored { time: 3.0 }, NoiseKind::Spline { knots: 5 }];
    for (number, noise) in kinds.into_iter().enumerate() {
        let (term, pushed) = (|| Some(term.clone()), Some(pushed.clone()));
        for (value, disturbance) in [(None, None), (term(), pushed), (term(), None)] {
            let independent = noise == NoiseKind::Independent;
            let settings = MppiSettings {
                noise,
                antithetic: number == 1,
                noise_cost: independent && value.is_none(),
                ..MppiSettings::new(&system.controls(), 100, 9)
            };
            let spec = MppiSpec::new(settings).expect("settings");
            let name = format!("{} {noise:?}, value network: {}", system.name(), value.is_some());
            let planning = Planning::of(system, cost.clone(), spec);
            out.push((name, MppiText::new(&Planning { value, disturbance, ..planning })));
        }
    }
}

/// The cost of [`Scalar`].
impl Cost<1, 1, 1> for Scalar {
    fn stage<R: Real>(&self, [x]: [R; 1], [u]: [R; 1], [goal]: [R; 1]) -> R {
        (x - goal) * (x - goal) + u * u
    }
}

/// A map of three columns and two rows.
fn map(costs: &[f32]) -> CostMap {
    let grid = Grid { origin: [0.0; 2], resolution: 1.0, size: [3, 2] };
    CostMap::new(grid, costs, 1.0).expect("a map")
}

fn mppi_texts() -> Vec<(String, MppiText)> {
    let mut all = Vec::new();
    mppi_texts_of(&Scalar, &Scalar, &mut all);
    let quadratic =
        Quadratic::<2, 1> { state: [1.0; 2], control: [0.1], last: [2.0; 2], obstacle: None };
    mppi_texts_of::<_, _, 2, 1, 3>(&DoubleIntegrator::default(), &quadratic, &mut all);
    let safety = Safety { weight: 1.0, ..Safety::NONE };
    let fence = Fence { weight: 1.0, margin: 0.1 };
    let cost = RaceCost::Recovery(RecoveryCost {
        position: 1.0,
        velocity: 1.0,
        control: 0.1,
        safety,
        fence,
    });
    mppi_texts_of(&DroneRace::default(), &cost, &mut all);
    let goal = GoalCost { distance: 1.0, angle: 1.0, map: map(&[0.0; 6]) };
    mppi_texts_of(&DiffDrive::default(), &goal, &mut all);
    all.push(("skiff, costs of a text".to_owned(), MppiText::new(&costs::skiff(9).0)));
    all.push(("skiff, a map besides".to_owned(), MppiText::new(&with_map(costs::skiff(9).0))));
    all
}

/// The same where a map charges besides, and stage and end ask one other map each.
fn with_map(planning: Planning) -> Planning {
    let (inputs, contexts) = (planning.model.inputs(), planning.cost.contexts);
    let (charged, asked) = (map(&[0.0; 6]), Arc::new(map(&[1.0; 6])));
    let cell = |map: &CostMap, inputs| record(inputs, |x| vec![map.cell([x[0], x[1]])]);
    let places = Lookups { cells: cell(&asked, inputs + contexts), maps: vec![asked] };
    let charge = MapCost { cell: cell(&charged, inputs), map: Arc::new(charged) };
    let formula = record(inputs + contexts + 1, |x| vec![x[0] * x[inputs + contexts]]);
    let terminal = TerminalCost { formula: formula.clone(), lookups: Some(places.clone()) };
    let cost = StageCost::new(formula, contexts, Some(charge)).with_lookups(Some(places));
    let cost = cost.with_terminal(Some(terminal));
    Planning { cost: Arc::new(cost), ..planning }
}

fn each_kernel(mut see: impl FnMut(&str, Bindings<'_>, &naga::Module, &ModuleInfo)) {
    for (plant, text) in all_plants() {
        // Only some networks see other things than the state.
        let links = 0..text.chain().map_or(0, |chain| chain.count() as u32);
        let kernels = Kernel::ROLLOUT.into_iter().chain(links.map(Kernel::Link));
        for kernel in kernels.filter(|kernel| *kernel != Kernel::Observe || text.observes()) {
            let name = format!("{kernel:?} of {plant}");
            let (module, info) = validated(&name, &text.compose(kernel));
            let bindings = text.bindings(kernel);
            see(&name, (kernel, text.lanes(kernel), &bindings), &module, &info);
        }
    }
    let normed = text(&Model::of(DoubleIntegrator::default()), &normed());
    for kernel in [Kernel::Sums, Kernel::Norm(0), Kernel::Layer(1)] {
        let name = format!("{kernel:?} of a network with a norm");
        let (module, info) = validated(&name, &normed.compose(kernel));
        let bindings = normed.bindings(kernel);
        see(&name, (kernel, normed.lanes(kernel), &bindings), &module, &info);
    }
    for (plant, text) in mppi_texts() {
        for kernel in text.kernels() {
            let name = format!("{kernel:?} of {plant}");
            let (module, info) = validated(&name, &text.compose(kernel));
            let bindings = text.bindings(kernel);
            see(&name, (kernel, kernel.workgroup(), &bindings), &module, &info);
        }
    }
    for kernel in Kernel::LIMITS {
        let (text, bindings) = (limit_kernel(kernel), kernel.bindings(false));
        let name = format!("{kernel:?}");
        let (module, info) = validated(&name, &text);
        see(&name, (kernel, kernel.workgroup(), &bindings), &module, &info);
    }
}

/// The name under which the shaders declare a slot.
fn declared_names(slot: Slot) -> &'static [&'static str] {
    match slot {
        Slot::Params => &["params"],
        Slot::Region => &["region"],
        Slot::Schedule => &["schedule"],
        Slot::State => &["state"],
        Slot::Folds => &["folds"],
        Slot::Origin => &["origin"],
        Slot::Control => &["control"],
        Slot::Measures => &["measures", "pair_measures"],
        Slot::Distances => &["distances"],
        Slot::Farthest => &["farthest"],
        Slot::KeptState => &["kept_state"],
        Slot::KeptFolds => &["kept_folds"],
        Slot::KeptOrigin => &["kept_origin"],
        Slot::Survivors => &["survivors"],
        Slot::Weights => &["weights"],
        Slot::Source => &["source"],
        Slot::Sink => &["sink"],
        Slot::Streams => &["streams"],
        Slot::Plans => &["plans"],
        Slot::Starts => &["starts"],
        Slot::Totals => &["totals"],
        Slot::Spline => &["spline"],
        Slot::Carry => &["carry"],
        Slot::Value => &["value"],
        Slot::Push => &["push"],
        Slot::Partials => &["partials"],
        Slot::Values => &["values"],
        Slot::Cells => &["cells"],
        Slot::Kept => &["kept"],
        Slot::Asked => &["asked"],
        Slot::Said => &["said"],
        Slot::Blocks => &["blocks"],
        Slot::Left => &["left"],
        Slot::Counts => &["counts"],
    }
}

#[test]
fn bindings_are_those_that_rust_lists() {
    each_kernel(|name, (_, _, listed), module, info| {
        let entry = info.get_entry_point(0);
        let mut declared = 0;
        for (handle, variable) in module.global_variables.iter() {
            let Some(binding) = &variable.binding else {
                let own = [AddressSpace::WorkGroup, AddressSpace::Private];
                assert!(own.contains(&variable.space), "{name}");
                continue;
            };
            declared += 1;
            let variable_name = variable.name.as_deref().unwrap_or_default();
            assert_eq!(binding.group, 0, "{name}: {variable_name}");
            let found = listed.iter().find(|(slot, _)| *slot as u32 == binding.binding);
            let (slot, access) =
                found.unwrap_or_else(|| panic!("{name}: {variable_name} unlisted"));
            assert!(
                declared_names(*slot).contains(&variable_name),
                "{name}: {variable_name} stands in the slot of {slot:?}"
            );
            let expected = match variable.space {
                AddressSpace::Uniform if *slot == Slot::Params => Access::Uniform,
                AddressSpace::Uniform => Access::Constant,
                AddressSpace::Storage { .. } if *slot == Slot::Blocks => Access::Blocks,
                AddressSpace::Storage { access } if access.contains(StorageAccess::STORE) => {
                    Access::ReadWrite
                }
                AddressSpace::Storage { .. } => Access::Read,
                other => panic!("{name}: {variable_name} lies in {other:?}"),
            };
            assert_eq!(*access, expected, "{name}: {variable_name}");
            let used = !entry[handle].is_empty();
            assert!(used, "{name}: {variable_name} is declared and never used");
        }
        assert_eq!(declared, listed.len(), "{name}: listed but not declared");
    });
}

#[test]
fn no_two_types_have_one_shape() {
    each_kernel(|name, _, module, _| drivers::assert_types_differ(name, module));
}

/// An array under a name of its own: valid WGSL, and invalid SPIR-V where it is passed for the array.
const ALIASED: &str = "
alias Pair = array<f32, 2>;
@group(0) @binding(0) var<storage, read_write> sink: array<f32>;
fn added(x: array<f32, 2>) -> f32 {
    return x[0] + x[1];
}
@compute @workgroup_size(1)
fn main() {
    let x = Pair(sink[0], sink[1]);
    sink[0] = added(x);
}
";

#[test]
#[should_panic(expected = "two types of the shape")]
fn an_array_with_a_name_is_a_second_type() {
    let (module, _) = validated("aliased", ALIASED);
    drivers::assert_types_differ("aliased", &module);
}

#[test]
fn an_array_with_a_name_is_invalid_spir_v() {
    if drivers::validator_is_there() {
        let (module, info) = validated("aliased", ALIASED);
        let folder = tempfile::tempdir().expect("a folder");
        let complaint = drivers::complaint(&module, &info, folder.path());
        assert!(complaint.is_some_and(|text| text.contains("OpFunctionCall")), "it is taken");
    }
}

#[test]
fn kernels_are_written_for_metal_and_direct3d() {
    each_kernel(|name, (kernel, ..), module, info| {
        for text in drivers::translate(name, module, info) {
            assert!(text.contains(kernel.entry()), "{name}:\n{text}");
        }
    });
}

#[test]
fn kernels_are_valid_spir_v() {
    if !drivers::validator_is_there() {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let (mut seen, mut wrong) = (0, Vec::new());
    each_kernel(|name, _, module, info| {
        seen += 1;
        let complaint = drivers::complaint(module, info, folder.path());
        wrong.extend(complaint.map(|complaint| format!("{name}: {complaint}")));
    });
    println!("{seen} kernels through spirv-val, {} invalid", wrong.len());
    assert!(wrong.is_empty() && seen > 100, "{} of {seen}:\n{}", wrong.len(), wrong.join("\n"));
}

#[test]
fn entry_points_and_workgroups() {
    each_kernel(|name, (kernel, lanes, _), module, _| {
        let [entry] = module.entry_points.as_slice() else {
            panic!("{name} has not one entry point");
        };
        assert_eq!(entry.name, kernel.entry(), "{name}");
        assert_eq!(entry.workgroup_size, [lanes, 1, 1], "{name}");
    });
}

#[test]
fn storage_fits_the_least_that_adapters_offer() {
    each_kernel(|name, (_, _, bindings), _, _| {
        let uniform = [Access::Uniform, Access::Constant];
        let storage = bindings.iter().filter(|(_, access)| !uniform.contains(access)).count();
        assert!(storage <= 8, "{name} binds {storage} storage buffers");
    });
}

#[test]
fn uniform_block_has_the_layout_of_params() {
    // Each field in turn, in the order of the Rust struct.
    let zero = Params::zeroed();
    macro_rules! offsets {
        ($($field:ident),*) => {{
            // Fails to compile if a field is missing.
            let Params { $($field: _),* } = zero;
            vec![$((stringify!($field), std::mem::offset_of!(Params, $field))),*]
        }};
    }
    let expected = offsets!(
        key_low,
        key_high,
        stream,
        zero,
        pair_key_low,
        pair_key_high,
        pair_stream,
        pair_radius,
        first_low,
        first_high,
        columns,
        stride,
        step,
        steps,
        horizon,
        region_kind,
        paired,
        closed_loop,
        sign_only,
        layer_offset,
        layer_inputs,
        layer_outputs,
        layer_neurons,
        segment_start,
        iteration,
        samples,
        width,
        rounds,
        temperature
    );
    each_kernel(|name, (kernel, ..), module, _| {
        if kernel == Kernel::Narrow {
            // It changes blocks of parameters, and has none itself.
            return;
        }
        let (_, params) = module
            .types
            .iter()
            .find(|(_, kind)| kind.name.as_deref() == Some("Params"))
            .unwrap_or_else(|| panic!("{name} has no Params"));
        let TypeInner::Struct { members, span } = &params.inner else {
            panic!("{name}: Params is not a struct");
        };
        let declared: Vec<(&str, usize)> = members
            .iter()
            .map(|member| (member.name.as_deref().unwrap_or(""), member.offset as usize))
            .collect();
        assert_eq!(declared, expected, "{name}");
        assert_eq!(*span as usize, size_of::<Params>(), "{name}");
        for member in members {
            let float = matches!(member.name.as_deref(), Some("pair_radius" | "temperature"));
            let scalar = if float { naga::Scalar::F32 } else { naga::Scalar::U32 };
            let inner = &module.types[member.ty].inner;
            assert_eq!(*inner, TypeInner::Scalar(scalar), "{name}");
        }
    });
}

/// What a map costs is data: another map of the same size compiles no kernel anew.
#[test]
fn a_map_is_not_part_of_the_text() {
    let text = |costs: &[f32]| {
        let mut all = Vec::new();
        let goal = GoalCost { distance: 1.0, angle: 1.0, map: map(costs) };
        mppi_texts_of(&DiffDrive::default(), &goal, &mut all);
        all
    };
    assert_eq!(text(&[0.0; 6]), text(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]));
    for (name, text) in mppi_texts() {
        let rollout = text.compose(Kernel::MppiRollout);
        let has = name.starts_with("diff-drive") || name.ends_with("a map besides");
        assert_eq!(rollout.contains("cell_at"), has, "{name}");
    }
}

/// What a parameter is worth is data: another value compiles no kernel anew.
#[test]
fn a_parameter_is_not_part_of_the_text() {
    for driver in DRIVERS {
        let text = |values| {
            let plant = driver.plant(values);
            text(&plant.model, &plant.controller)
        };
        assert_eq!(text(VALUES), text([1.5, -2.0, 0.0, 7.25, 1.0e9]), "{driver:?}");
    }
}

/// A formula that reads neither time nor parameters is not given them.
#[test]
fn what_a_formula_does_not_read_it_does_not_pay_for() {
    let plain = Model::of(Scalar);
    let clamped = Controller::of(&Scalar, Clamped);
    let plain = text(&plain, &clamped).compose(Kernel::ReachAvoid);
    assert!(!plain.contains("seconds") && !plain.contains("f32(t)"), "{plain}");
    assert!(!plain.contains("parameters()"), "{plain}");
    let drift = models::Driver::Formula.plant(VALUES);
    let drift = text(&drift.model, &drift.controller).compose(Kernel::ReachAvoid);
    assert!(drift.contains("plant_target(x, parameters(), f32(t))"), "{drift}");
    assert!(drift.contains("plant_constraint(x, parameters(), seconds_at(t))"), "{drift}");
}

/// Formulas that do not fit their place are refused with the figures.
#[test]
fn formulas_that_do_not_fit_are_refused() {
    let plant = models::Driver::Wrapped.plant(VALUES);
    let refused = |model: &Model, controller: &Controller| {
        PlantText::new(model, controller).expect_err("it does not fit").to_string()
    };
    let mut short = (*plant.model).clone();
    short.target = short.step.clone();
    let text = refused(&short, &plant.controller);
    assert!(text.contains("target") && text.contains("12 inputs to 3 outputs"), "{text}");
    let mut blind = (*plant.model).clone();
    blind.constraint = reachcast::formula::record(12, |inputs| vec![inputs[3]]);
    let text = refused(&blind, &plant.controller);
    assert!(text.contains("plant_constraint") && text.contains("control"), "{text}");
    let Law::Network { network, act, .. } = plant.controller.law.clone() else {
        panic!("it is driven by a network");
    };
    let narrow = Controller::new("narrow", Law::Network { observe: None, network, act });
    let text = refused(&plant.model, &narrow);
    assert!(text.contains("5 inputs") && text.contains("3 states"), "{text}");
}

#[test]
fn tile_of_the_layer_kernel_is_the_one_that_is_dispatched() {
    use reachcast::backend::gpu::compose::{TILE_COLUMNS, TILE_QUADS};
    let (_, text) = all_plants().swap_remove(1);
    let text = text.compose(Kernel::Layer(0));
    assert!(text.contains(&format!("const TILE_COLUMNS: u32 = {TILE_COLUMNS}u;")));
    let stores = text.matches("tile.upper_").count() + text.matches("tile.lower_").count();
    assert_eq!(stores as u32, TILE_COLUMNS * TILE_QUADS);
}

#[test]
fn fused_activations_take_the_workgroup_memory_that_is_planned() {
    let tiles = |trajectories, size| Form::Tiles { trajectories, neurons: size, columns: size };
    // Bytes of a number: for each input of the widest layer, of 12 padded to 16 at least, and trajectory;
    // in slices 16 more per neuron, in rows twice.
    for (hidden, form, lanes, bytes) in [
        (3, tiles(64, 8), 64, 4 * 16 * 64),
        (64, tiles(64, 8), 64, 4 * 64 * 64),
        (65, tiles(64, 8), 96, 4 * 72 * 64),
        (128, tiles(16, 4), 128, 4 * 128 * 16),
        (64, Form::Slices { trajectories: 64 }, 64, 4 * 64 * (64 + 16)),
        (128, Form::Slices { trajectories: 32 }, 64, 4 * 128 * (32 + 16)),
        (64, Form::Rows { trajectories: 8 }, 64, 2 * 4 * 64 * 8),
    ] {
        let mlp = network_of(12, hidden, 3, Activation::Relu);
        let fused = Fused::new(&mlp, form).expect("the network has the form");
        assert_eq!((fused.lanes(), fused.workgroup_bytes()), (lanes, bytes), "{hidden} {form:?}");
        let race = DroneRace::default();
        let controller = Controller::of(&race, mlp);
        let text = text(&Model::of(race), &controller).fusing(Some(fused));
        let (module, _) = validated("fused", &text.compose(Kernel::ReachAvoid));
        let shared = module.global_variables.iter().map(|(_, variable)| variable);
        let shared = shared.filter(|variable| variable.space == AddressSpace::WorkGroup);
        let size = |variable: &naga::GlobalVariable| {
            u64::from(module.types[variable.ty].inner.size(module.to_ctx()))
        };
        assert_eq!(shared.map(size).sum::<u64>(), bytes, "{hidden} {form:?}");
    }
}
