//! The tier of many states at once: certificates that are made while the plant moves.

use crate::backend::Program;
use crate::error::{Error, Result};
use crate::rollout::{Ball, Query, StateList, States};
use crate::scenario::boundary::on_slice;
use crate::scenario::criterion::Criterion;
use crate::scenario::drops_record::SequenceRecord;
use crate::scenario::enclosure::Enclosure;
use crate::scenario::fit::check_sizes;
use crate::scenario::global::{band, slice_through};
use crate::scenario::growth::{Growth, check_scenarios};
use crate::scenario::growth_batch::{Request, grow_each};
use crate::scenario::growth_plan::GrowthShape;
use crate::scenario::ledger::{Entry, Ledger, Spend};
use crate::scenario::sets::chosen;
use crate::scenario::settings::{GrowthSettings, Settings};
use crate::scenario::{Context, Tightened, Unwatched, tightened};

pub use crate::scenario::tier::Tier;

/// Which certificates are asked for; without one its tier is empty.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Asked {
    /// Tier 1: the certified set.
    pub global: bool,
    /// Tier 2: local growth.
    pub local: bool,
    /// Where tier 1 may hold.
    pub domain: Domain,
}

/// Where a state may count as certified.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Domain {
    /// In the box that the deviation bound was drawn from: outside it says nothing.
    Box,
    /// Anywhere, as in the study.
    Anywhere,
}

/// What the certificates say of a state.
#[derive(Clone, Debug, PartialEq)]
pub struct Standing {
    /// Tier 1, 2 or 3.
    pub tier: Tier,
    /// `V_check`.
    pub check_margin: f32,
    /// The certified cells of the slice through the state, row by row; empty if it was not needed.
    pub certified: Vec<bool>,
    /// The ball of local growth; none if there was nothing to grow from, or no beta left.
    pub growth: Option<LocalGrowth>,
    /// Whether growth was not called because no beta was left.
    pub refused: bool,
}

/// A ball grown for a state.
#[derive(Clone, Debug, PartialEq)]
pub struct LocalGrowth {
    /// The ball: verified, or the last one tried.
    pub ball: Ball,
    /// Whether it passed clean.
    pub verified: bool,
    /// Rounds taken.
    pub rounds: u32,
    /// Starts run again in f64.
    pub f64_reruns: u64,
}

/// A state to be judged, with the identity of its run.
#[derive(Debug)]
pub struct Case<'a> {
    /// The state.
    pub state: Vec<f32>,
    /// Seed of the run's random numbers.
    pub seed: u64,
    /// Number of the control step: each has samples of its own.
    pub step: u32,
    /// What the run has spent.
    pub ledger: &'a mut Ledger,
}

/// Everything that is known before the plant moves: constants, deviation bound, band.
pub struct Certifier<'a> {
    program: &'a Program<'a>,
    settings: &'a Settings,
    tightened: Tightened,
    criterion: Criterion<'a>,
    sequence: Option<SequenceRecord>,
    band: f64,
    asked: Asked,
}

impl<'a> Certifier<'a> {
    /// Computes the constants, draws the deviation bound and measures the f32 error.
    ///
    /// # Errors
    /// [`Error::TooFewScenarios`] for local growth, those of [`tightened`], and [`Error::Refused`] if a
    /// pair met a state that is not finite.
    pub fn new(program: &'a Program<'a>, settings: &'a Settings, asked: Asked) -> Result<Self> {
        if asked.local {
            check_scenarios(&settings.growth)?;
            check_ball(&settings.growth)?;
        }
        check_sizes(settings, &program.plant().model)?;
        Enclosure::of(program.plant(), settings)?;
        let context = Context { program, watch: &Unwatched };
        let mut tightened = tightened(context, settings)?;
        let mut sequence = None;
        if let (Some(drops), Some(bound)) = (&settings.drops, &tightened.drops) {
            let (tightening, chosen) = chosen(context, settings, drops, bound)?;
            (tightened.tightening, sequence) = (tightening, Some(chosen));
        }
        let lost = tightened.deviation.non_finite;
        if lost > 0 && tightened.drops.is_none() && settings.enclosed.is_none() {
            let problem = format!("{lost} rollouts of the deviation bound are not finite");
            return Err(Error::Refused(problem));
        }
        let band = band(context, settings, &tightened.tightening)?;
        let criterion = Criterion::new(program.plant(), settings, &tightened.tightening)?;
        Ok(Self { program, settings, tightened, criterion, sequence, band, asked })
    }

    /// The settings of the certificates.
    pub fn settings(&self) -> &Settings {
        self.settings
    }

    /// Constants and deviation bound.
    pub fn tightened(&self) -> &Tightened {
        &self.tightened
    }

    /// The sequence of sets that tier 1 was chosen from, by margin drops.
    pub fn sequence(&self) -> Option<&SequenceRecord> {
        self.sequence.as_ref()
    }

    /// Measures this close to zero are run again in f64.
    pub fn band(&self) -> f64 {
        self.band
    }

    /// The standing of each case, all in a few batches: V_check of all, then slice and growth of
    /// those that it does not certify.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a state that has not the numbers of the model, and those of the backend.
    pub fn standings(&self, cases: &mut [Case<'_>]) -> Result<Vec<Standing>> {
        let size = self.settings.state.len();
        if let Some(i) = cases.iter().position(|case| case.state.len() != size) {
            let has = cases[i].state.len();
            let problem = format!("case {i} has {has} numbers, a state has {size}");
            return Err(Error::invalid("state", problem));
        }
        let states = self.list().with(cases.iter().map(|case| &*case.state));
        let margins = self.margins(states.view(), Query::Measure)?;
        let standing = |(state, check_margin): (&[f32], f32)| Standing {
            tier: match self.asked.global && check_margin > 0.0 && self.covers(state) {
                true => Tier::Global,
                false => Tier::Recovery,
            },
            check_margin,
            certified: Vec::new(),
            growth: None,
            refused: false,
        };
        let mut standings: Vec<Standing> = states.iter().zip(margins).map(standing).collect();
        let open = |standing: &Standing| standing.tier == Tier::Recovery;
        let left: Vec<usize> = (0..cases.len()).filter(|&i| open(&standings[i])).collect();
        self.slices(states.view(), &left, &mut standings)?;
        if self.asked.local {
            self.grow(cases, &left, &mut standings)?;
        }
        Ok(standings)
    }

    /// No state yet.
    fn list(&self) -> StateList {
        StateList::new(self.settings.state.len())
    }

    /// Whether the deviation bound speaks of `state`, as far as that is asked.
    fn covers(&self, state: &[f32]) -> bool {
        self.asked.domain == Domain::Anywhere || self.settings.in_box(state)
    }

    /// `V_check` of each state, or its sign.
    fn margins(&self, states: States<'_>, query: Query) -> Result<Vec<f32>> {
        let context = Context { program: self.program, watch: &Unwatched };
        self.criterion.margins(context, &self.settings.spec, states, query, self.band)
    }

    /// The certified cells of the slices through the states `left`. Signs in f32: a cell says
    /// where to grow a ball and where to steer, and claims nothing.
    fn slices(&self, states: States<'_>, left: &[usize], standings: &mut [Standing]) -> Result<()> {
        let slices = left.iter().map(|&i| slice_through(self.settings, states.row(i)));
        let cells = slices.fold(self.list(), |cells, slice| cells.with(slice.iter()));
        let per_slice = cells.len() / left.len().max(1);
        let signs = self.margins(cells.view(), Query::Sign)?;
        for (&i, signs) in left.iter().zip(signs.chunks(per_slice.max(1))) {
            standings[i].certified = signs.iter().map(|sign| *sign > 0.0).collect();
        }
        Ok(())
    }

    /// Grows a ball for each of the cases `left` whose slice has a boundary and whose ledger
    /// allows it. The centre is the boundary cell of the slice that the study's rule picks: the ray
    /// search of a stored certificate costs a hundred times as many rollouts.
    fn grow(
        &self,
        cases: &mut [Case<'_>],
        left: &[usize],
        standings: &mut [Standing],
    ) -> Result<()> {
        let mut requests = Vec::new();
        let mut asking = Vec::new();
        for &i in left {
            let case = &mut cases[i];
            let found = on_slice(self.settings, &case.state, &standings[i].certified);
            let Some(boundary) = found else { continue };
            let entry = Entry {
                claim: "local growth".to_owned(),
                purpose: "tier 2".to_owned(),
                call: u64::from(case.step),
                round: 0,
                beta: self.settings.growth.call_beta(),
            };
            if let Spend::Refused { .. } = case.ledger.spend(entry) {
                standings[i].refused = true;
                continue;
            }
            requests.push(Request { center: boundary.point, seed: case.seed, call: case.step });
            asking.push(i);
        }
        let context = Context { program: self.program, watch: &Unwatched };
        let grown = grow_each(context, self.settings, &requests, self.band)?;
        for ((i, request), grown) in asking.into_iter().zip(requests).zip(grown) {
            let (ball, verified) = match grown.outcome {
                Growth::Verified(ball) => (ball, true),
                Growth::Exhausted { last_radius: radius } => {
                    let varies = self.settings.growth.varies.clone();
                    (Ball { center: request.center.clone(), radius, varies }, false)
                }
            };
            if verified && ball.contains(&cases[i].state) {
                standings[i].tier = Tier::Local;
            }
            let (rounds, f64_reruns) = (grown.rounds, grown.f64_reruns);
            standings[i].growth = Some(LocalGrowth { ball, verified, rounds, f64_reruns });
        }
        Ok(())
    }
}

/// Refuses what grows where it is no ball.
fn check_ball(asked: &GrowthSettings) -> Result<()> {
    match asked.plan.shape {
        GrowthShape::Ball => Ok(()),
        other => {
            let problem = format!("`{}` is for `certify`; tier 2 grows balls", other.name());
            Err(Error::invalid("growth.shape", problem))
        }
    }
}
