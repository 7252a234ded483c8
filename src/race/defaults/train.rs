//! Training of the race's policies.

use std::collections::BTreeMap;

use crate::config::train::{common, named, part};
use crate::train::settings::{StartsSection, TrainSettings};

/// Training for the race: half of the starts from the whole box, a quarter from where races
/// start, a quarter from a wider box around that.
pub(super) fn race() -> TrainSettings {
    let slow = part(0.5, &[("opp_vy", [0.1, 0.45])]);
    let start = drones(0.25, [0.8, 0.0, 0.1, 0.1], [-2.5, -1.0], [[0.5, 0.7], [0.3, 0.5]]);
    let wide = drones(0.25, [0.95, 0.5, 0.3, 0.3], [-2.8, -0.2], [[0.1, 1.0], [0.2, 0.55]]);
    let mut settings = common(vec![64; 3]);
    settings.ddpg.disturbance = named(&[("opp_vx", 0.01), ("opp_vy", 0.01), ("opp_vz", 0.01)]);
    // Beyond the gate, so that the way there leads through it.
    settings.ppo.reward.goal = named(&[("ego_x", 0.0), ("ego_y", 0.5), ("ego_z", 0.0)]);
    TrainSettings { starts: vec![slow, start, wide], ..settings }
}

/// Both drones in boxes that differ in their speed toward the gate alone: `around` bounds position
/// and velocity across, then height and climb.
fn drones(share: f64, around: [f64; 4], along: [f64; 2], speeds: [[f64; 2]; 2]) -> StartsSection {
    let mut bounds = BTreeMap::new();
    for (drone, speed) in ["ego", "opp"].into_iter().zip(speeds) {
        let mut insert =
            |state: &str, interval| bounds.insert(format!("{drone}_{state}"), interval);
        for (state, reach) in ["x", "vx", "z", "vz"].into_iter().zip(around) {
            insert(state, [-reach, reach]);
        }
        insert("y", along);
        insert("vy", speed);
    }
    StartsSection { share, bounds }
}
