//! Whether settings are of the states of a model.

use super::settings::Settings;
use crate::error::{Error, Result};
use crate::model::Model;

/// Refuses settings whose lists have another length than `model` has states, that name a state which it has
/// not, or whose horizon ends before a time of its task.
///
/// # Errors
/// [`Error::Invalid`] naming the setting or the key of the task, with both figures.
pub(crate) fn check_sizes(settings: &Settings, model: &Model) -> Result<()> {
    let Settings { state, low, high, growth, slice, .. } = settings;
    let (name, states) = (&model.name, model.states.len());
    let lists = [("state", state.len()), ("low", low.len()), ("high", high.len())];
    for (place, has) in lists.into_iter().chain([("growth.varies", growth.varies.len())]) {
        if has != states {
            let problem = format!("has {has} entries, the model `{name}` has {states} states");
            return Err(Error::invalid(place, problem));
        }
    }
    let across = slice.iter().flatten().map(|axis| ("slice", axis.state));
    let ahead = growth.heading.iter().flatten().map(|state| ("growth.heading", *state));
    match across.chain(ahead).find(|(_, state)| *state >= states) {
        None => model.task.check(settings.spec.horizon),
        Some((place, state)) => {
            let last = states.saturating_sub(1);
            let problem = format!("no state number {state}; `{name}` has the states 0 to {last}");
            Err(Error::invalid(place, problem))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rollout::RolloutSpec;
    use crate::system::DoubleIntegrator;

    #[test]
    fn settings_of_another_model_are_refused() {
        let model = Model::of(DoubleIntegrator::default());
        let spec = RolloutSpec::new(10, 0.9).expect("a horizon");
        let short = Settings::new(&model, [0.0], spec).expect_err("one number for two states");
        let short = short.to_string();
        assert!(short.contains("state: 1 numbers") && short.contains("2 states: "), "{short}");
        let right = Settings::new(&model, [0.0, 0.0], spec).expect("two states");
        check_sizes(&right, &model).expect("settings of the model");
        let change = |change: &dyn Fn(&mut Settings)| {
            let mut settings = right.clone();
            change(&mut settings);
            check_sizes(&settings, &model).expect_err("refused").to_string()
        };
        for (found, words) in [
            (change(&|s| s.state.push(0.0)), "state: has 3 entries"),
            (change(&|s| s.low.clear()), "low: has 0 entries"),
            (change(&|s| s.high.push(1.0)), "high: has 3 entries"),
            (change(&|s| s.growth.varies.truncate(1)), "growth.varies: has 1 entries"),
            (change(&|s| s.growth.heading = Some([0, 1, 2, 1])), "heading: no state number 2"),
            (
                change(&|s| s.slice.iter_mut().for_each(|axes| axes[1].state = 7)),
                "slice: no state number 7; `double-integrator` has the states 0 to 1",
            ),
        ] {
            assert!(found.contains(words), "no `{words}` in: {found}");
        }
    }
}
