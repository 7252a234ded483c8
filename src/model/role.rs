//! What a step of a rollout is to its task: which margins count there, and as what.

/// What the states of one step are to a task: any of the marks below together.
///
/// ```
/// use reachcast::model::Role;
/// let last = Role::LIVE.with(Role::CONSTRAINT).with(Role::CONCLUSION);
/// assert!(last.has(Role::CONSTRAINT) && !last.has(Role::CHANCE));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Role(u32);

impl Role {
    /// The task is over: nothing that happens here matters.
    pub const OVER: Self = Self(0);
    /// The task is not over: what is not finite fails it, if it has not succeeded before.
    pub const LIVE: Self = Self(1);
    /// The constraint has to hold.
    pub const CONSTRAINT: Self = Self(2);
    /// To be in the target is enough, if all has held until here.
    pub const CHANCE: Self = Self(4);
    /// The target has to hold.
    pub const REQUIREMENT: Self = Self(8);
    /// What had to hold at all steps has held, if it holds here.
    pub const CONCLUSION: Self = Self(16);
    /// Every step of a reach-avoid task without a window.
    pub const REACH_AVOID: Self = Self::LIVE.with(Self::CONSTRAINT).with(Self::CHANCE);

    /// Both together.
    #[must_use]
    pub const fn with(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// What both have.
    #[must_use]
    pub const fn and(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    /// Whether it has a mark of `other`.
    pub const fn has(self, other: Self) -> bool {
        self.0 & other.0 != 0
    }

    /// Whether the target margin counts.
    pub const fn sees_target(self) -> bool {
        self.has(Self::CHANCE.with(Self::REQUIREMENT))
    }

    /// Whether the constraint margin counts.
    pub const fn sees_constraint(self) -> bool {
        self.has(Self::CONSTRAINT)
    }

    /// Its marks as bits, below 32: what the schedule of a kernel says.
    pub const fn bits(self) -> u32 {
        self.0
    }
}
