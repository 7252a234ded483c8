//! Defaults of the race: the numbers of each profile, from the published study.

mod section;
mod train;

use crate::config::profile::{axis, common, names};
use crate::config::{Config, Constant, ConstantsSection, Coordinates, Profile, SliceSection};
use crate::race::system::{Cone, DroneRace};
use crate::studies::SystemSection;
use crate::system::System;

/// First of the 500 starts of the published study, `configs/race_starts_500.csv`.
const RACE_STATE: [f64; 12] = [
    0.7415519915922972,
    0.0,
    -1.0318051933867767,
    0.5269589927741894,
    -0.00831426835774926,
    -0.0925577927382397,
    -0.45164051298706803,
    0.0,
    -2.4884756227075835,
    0.31867728763257475,
    0.006058703491681097,
    -0.016398054808464832,
];

/// The race. Where the paper gives no number, `paper` has that of the study.
pub(crate) fn config(profile: Profile) -> Config {
    let published = profile != Profile::Rigorous;
    let mut states = DroneRace::default().states();
    if published {
        (states[9].low, states[9].high) = (-1.0, 1.0);
    }
    let given = |value| {
        if published { Constant::Given(value) } else { Constant::Computed }
    };
    let slice = SliceSection { x: axis("ego_x", -0.9, 0.9, 0.1), y: axis("ego_y", -2.6, 0.0, 0.1) };
    let system = SystemSection::DroneRace {
        cone: if profile == Profile::Paper { Cone::Squared } else { Cone::Distance },
        ego_gain: if profile == Profile::Paper { 1.0 } else { 0.5 },
        opponent_gain: 1.0,
        speed_limit: profile == Profile::Study,
    };
    let mut config = common(profile, Some(system), &states, &RACE_STATE, slice);
    config.constants =
        ConstantsSection { target: given(10.0), constraint: given(20.0), ..config.constants };
    config.growth.heading = names(["ego_x", "ego_vx", "ego_y", "ego_vy"]);
    config.study = Some(section::race(profile));
    config.train = Some(train::race());
    if profile == Profile::Study {
        // The study scores the first 30 states of a rollout, 29 steps.
        config.rollout.horizon = 29;
        config.growth.coordinates = Coordinates::Named(names(["ego_x", "ego_y"]));
    }
    config
}
