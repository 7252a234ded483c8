//! Flags that follow a NaN through a printed formula, beside its values.
//!
//! A driver may take `a - a` for 0 whatever `a` is, and a product with 0 likewise. Where a formula can
//! give birth to a NaN, so that one could be lost, each value that may be one has a flag, computed from
//! numbers that a driver cannot know; the outputs are marked by it. An infinity is followed from where a
//! quotient or a literal makes it; one from an overflow is met where a driver could hide it.

use crate::formula::Node;

/// What is known of a value wherever it is a number.
#[derive(Clone, Copy, Debug, Default)]
struct Known {
    /// It is not below 0.
    not_negative: bool,
    /// It is above 0.
    positive: bool,
    /// It may be infinite though nothing overflows.
    infinite: bool,
    /// Whether it is a NaN in any case.
    nan: bool,
}

/// The flags of a formula that is being printed.
pub(super) struct Flags<'a> {
    nodes: &'a [Node],
    known: Vec<Known>,
    /// The name of the flag of each value that has one.
    names: Vec<Option<String>>,
}

impl<'a> Flags<'a> {
    /// Those of a formula of `nodes`; none where no NaN can be lost.
    pub(super) fn of(nodes: &'a [Node]) -> Option<Self> {
        let mut known: Vec<Known> = Vec::with_capacity(nodes.len());
        for node in nodes {
            known.push(learnt(*node, &known));
        }
        let flags = Self { nodes, known, names: Vec::with_capacity(nodes.len()) };
        (0..nodes.len()).any(|i| flags.loses(i)).then_some(flags)
    }

    /// Whether value `i` may be the first NaN, or hide one.
    fn loses(&self, i: usize) -> bool {
        self.known[i].nan || self.birth(self.nodes[i]).is_some()
    }

    /// Whether `node` has no value though a driver that reckons with numbers knows one, by the operand
    /// that it then does not look at.
    fn hidden(&self, node: Node) -> Option<String> {
        let literal = |at: u32| match self.nodes[at as usize] {
            Node::Literal(bits) => Some(f32::from_bits(bits)),
            _ => None,
        };
        let zero = |at: u32| literal(at) == Some(0.0);
        let (at, than) = match node {
            Node::Sub(a, b) | Node::Div(a, b) if a == b => (a, ">="),
            Node::Mul(a, b) if zero(b) => (a, ">="),
            Node::Mul(a, b) if zero(a) => (b, ">="),
            // By infinity it is 0 indeed.
            Node::Div(a, b) if zero(a) => (b, ">"),
            _ => return None,
        };
        literal(at).is_none().then(|| format!("size_of(v{at}) {than} INFINITE"))
    }

    /// The flag of value `i`, if it has one.
    pub(super) fn name(&self, i: u32) -> Option<&str> {
        self.names[i as usize].as_deref()
    }

    /// The statement of the flag of the next value, behind its own statement; empty where it has none,
    /// or that of an operand.
    pub(super) fn next(&mut self) -> String {
        let i = self.names.len();
        let node = self.nodes[i];
        let mut parts: Vec<String> = self.handed(node);
        parts.extend(self.birth(node));
        match node {
            Node::Input(_) | Node::Said(..) => parts.push(format!("size_of(v{i}) > INFINITE")),
            Node::Literal(_) if self.known[i].nan => parts.push("true".to_owned()),
            _ => {}
        }
        parts.dedup();
        let plain = |part: &String| part.starts_with('n') && !part.contains(' ');
        let (name, text) = match &parts[..] {
            [] => (None, String::new()),
            [one] if plain(one) => (Some(one.clone()), String::new()),
            _ => {
                let all: Vec<String> = parts.iter().map(|part| format!("({part})")).collect();
                (Some(format!("n{i}")), format!("    let n{i} = {};\n", all.join(" | ")))
            }
        };
        self.names.push(name);
        text
    }

    /// The flags of the operands that a value depends on.
    fn handed(&self, node: Node) -> Vec<String> {
        let mut parts = Vec::new();
        let mut hand = |at: u32| parts.extend(self.name(at).map(str::to_owned));
        match node {
            Node::IfLt(a, b, yes, no) => {
                hand(a);
                hand(b);
                parts.extend(self.chosen(&format!("v{a} < v{b}"), [yes, no]));
            }
            Node::SelectLt(a, b, yes, no) => {
                parts.extend(self.chosen(&self.less(a, b), [yes, no]));
            }
            node => node.operands(hand),
        }
        parts
    }

    /// The flag of what is chosen.
    fn chosen(&self, condition: &str, [yes, no]: [u32; 2]) -> Option<String> {
        let [yes, no] = [yes, no].map(|at| self.name(at));
        match (yes, no) {
            (None, None) => None,
            (Some(yes), Some(no)) if yes == no => Some(yes.to_owned()),
            (yes, no) => {
                let (yes, no) = (yes.unwrap_or("false"), no.unwrap_or("false"));
                Some(format!("select({no}, {yes}, {condition})"))
            }
        }
    }

    /// Whether `a < b`, which a NaN is not.
    pub(super) fn less(&self, a: u32, b: u32) -> String {
        let numbers = [a, b].into_iter().filter_map(|at| self.name(at));
        let numbers: String = numbers.map(|flag| format!(" & !{flag}")).collect();
        let less = format!("v{a} < v{b}");
        if numbers.is_empty() { less } else { format!("({less}){numbers}") }
    }

    /// Whether operands that are no NaN make one, or one could be hidden; `None` where neither can be.
    fn birth(&self, node: Node) -> Option<String> {
        joined([self.hidden(node), self.exception(node)])
    }

    /// Whether finite or infinite operands make a NaN, as far as quotients and literals are infinite.
    fn exception(&self, node: Node) -> Option<String> {
        let known = |at: u32| self.known[at as usize];
        let infinite = |at: u32| known(at).infinite.then(|| format!("size_of(v{at}) == INFINITE"));
        let both = |a: u32, b: u32| Some(format!("({}) & ({})", infinite(a)?, infinite(b)?));
        let product = |a: u32, b: u32| Some(format!("({}) & (v{b} == 0.0)", infinite(a)?));
        match node {
            Node::Sqrt(a) if !known(a).not_negative => Some(format!("v{a} < 0.0")),
            // Of equal signs a sum is infinite, and so is a difference of different ones.
            Node::Add(a, b) => {
                both(a, b).map(|both| format!("{both} & ((v{a} < 0.0) != (v{b} < 0.0))"))
            }
            Node::Sub(a, b) => {
                both(a, b).map(|both| format!("{both} & ((v{a} < 0.0) == (v{b} < 0.0))"))
            }
            Node::Mul(a, b) => joined([product(a, b), product(b, a)]),
            Node::Div(a, b) => {
                let zeros = (!known(b).positive && !known(a).positive)
                    .then(|| format!("(v{a} == 0.0) & (v{b} == 0.0)"));
                joined([zeros, both(a, b)])
            }
            _ => None,
        }
    }
}

/// Either of two conditions, as far as there are any.
fn joined(conditions: [Option<String>; 2]) -> Option<String> {
    let conditions: Vec<String> = conditions.into_iter().flatten().collect();
    match &conditions[..] {
        [] => None,
        [one] => Some(one.clone()),
        all => Some(all.iter().map(|one| format!("({one})")).collect::<Vec<_>>().join(" | ")),
    }
}

/// What is known of the value of `node`, given what is of those before it.
fn learnt(node: Node, before: &[Known]) -> Known {
    let of = |at: u32| before[at as usize];
    let signs = |not_negative, positive| (not_negative || positive, positive);
    let (not_negative, positive) = match node {
        Node::Literal(bits) => signs(f32::from_bits(bits) >= 0.0, f32::from_bits(bits) > 0.0),
        Node::Abs(_) => (true, false),
        Node::Sqrt(a) => signs(true, of(a).positive),
        Node::Add(a, b) => signs(
            of(a).not_negative && of(b).not_negative,
            (of(a).positive && of(b).not_negative) || (of(a).not_negative && of(b).positive),
        ),
        // A product of small numbers may be 0.
        Node::Mul(a, b) | Node::Div(a, b) => {
            (a == b || (of(a).not_negative && of(b).not_negative), false)
        }
        Node::Max(a, b) => {
            signs(of(a).not_negative || of(b).not_negative, of(a).positive || of(b).positive)
        }
        Node::Min(a, b) | Node::IfLt(_, _, a, b) | Node::SelectLt(_, _, a, b) => {
            signs(of(a).not_negative && of(b).not_negative, of(a).positive && of(b).positive)
        }
        Node::Clamp(_, low, high) => signs(
            of(low).not_negative && of(high).not_negative,
            of(low).positive && of(high).positive,
        ),
        _ => (false, false),
    };
    let (infinite, nan) = match node {
        Node::Literal(bits) => {
            let value = f32::from_bits(bits);
            (value.is_infinite(), value.is_nan())
        }
        Node::Div(a, b) => (!of(b).positive || of(a).infinite, false),
        node => {
            let mut infinite = false;
            node.operands(|at| infinite |= of(at).infinite);
            (infinite, false)
        }
    };
    Known { not_negative, positive, infinite, nan }
}
