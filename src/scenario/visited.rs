//! Where rollouts go: the box that the Lipschitz constants are to hold on.

use super::constant_record::VisitedRecord;
use super::settings::Settings;
use super::{Context, pairs_f64, purpose};
use crate::error::Result;
use crate::rollout::side_by_side::PairGroup;
use crate::rollout::{Pairs, Region, Starts};

/// Most pilot pairs that are looked at.
const MOST_PAIRS: u64 = 256;
/// What each side is widened by at either end, in its widths.
const WIDENED: f64 = 0.1;

/// Rolls out pilot pairs in f64, so that every backend comes to the same hull.
pub(super) fn visited(context: Context<'_>, settings: &Settings) -> Result<VisitedRecord> {
    let stream = |purpose| settings.stream(purpose, 0);
    let region = Region::new_box(&*settings.low, &*settings.high)?;
    let pairs = Pairs {
        nominal: Starts::Drawn { region, stream: stream(purpose::PILOT_NOMINAL) },
        radius: settings.deviation.radius,
        stream: stream(purpose::PILOT_PERTURBATION),
    };
    let count = settings.deviation.pilot.min(MOST_PAIRS);
    let indices: Vec<u64> = (0..count).collect();
    let (plant, horizon) = (context.plant(), settings.spec.horizon);
    let of = |group: &PairGroup| {
        let mut hull = Hull::of_starts(settings);
        for (pair, looks) in group.open_looks(&plant.model).into_iter().enumerate() {
            for look in 0..looks {
                group.states(pair, look).iter().for_each(|x| hull.add(x));
            }
        }
        hull
    };
    let control = settings.deviation.control;
    let groups = pairs_f64::groups(plant, &pairs, &indices, horizon, control, of);
    let hull = groups.into_iter().fold(Hull::of_starts(settings), Hull::merge);
    Ok(hull.widened(settings.deviation.radius, count))
}

/// Ends of each coordinate.
struct Hull {
    low: Vec<f64>,
    high: Vec<f64>,
}

impl Hull {
    /// The box of starts.
    fn of_starts(settings: &Settings) -> Self {
        let wide = |side: &[f32]| side.iter().copied().map(f64::from).collect();
        Self { low: wide(&settings.low), high: wide(&settings.high) }
    }

    /// Takes in a state; one that is not finite lies nowhere.
    fn add(&mut self, x: &[f64]) {
        if x.iter().all(|x| x.is_finite()) {
            self.low.iter_mut().zip(x).for_each(|(low, x)| *low = low.min(*x));
            self.high.iter_mut().zip(x).for_each(|(high, x)| *high = high.max(*x));
        }
    }

    fn merge(mut self, other: Self) -> Self {
        self.add(&other.low);
        self.add(&other.high);
        self
    }

    /// The record, its ends rounded outwards and within f32.
    fn widened(self, radius: f32, pairs: u64) -> VisitedRecord {
        let ends = self.low.into_iter().zip(self.high).map(|(low, high)| {
            let more = (WIDENED * (high - low)).max(f64::from(radius));
            [((low - more) as f32).next_down(), ((high + more) as f32).next_up()]
        });
        let (low, high) = ends.map(|[low, high]| (low.max(f32::MIN), high.min(f32::MAX))).unzip();
        VisitedRecord { pairs, widened: WIDENED, low, high }
    }
}
