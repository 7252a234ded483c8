//! The grammar of formulas: strengths and sides of operators, limits, faults with their columns.

use std::time::{Duration, Instant};

use proptest::prelude::*;
use reachcast::formula::text::{Fault, Formula, Function, Names, Networks, Values};

/// `x` = 3, `y` = -2, `t` is unknown.
fn names() -> Names {
    let mut names = Names::default();
    for name in ["x", "y", "heading"] {
        names.add(name, "a state").expect("a name");
    }
    names
}

fn value(text: &str) -> f64 {
    let formula =
        Formula::parse(text, &names()).unwrap_or_else(|fault| panic!("{text}: {fault:?}"));
    let networks = Networks::default();
    formula.value(Values {
        names: &[3.0, -2.0, 0.5],
        outputs: &[10.0, 20.0],
        looked: &[],
        networks: &networks,
    })
}

/// The column and the words of the fault of `text`.
fn fault(text: &str) -> (usize, String) {
    let fault: Fault = Formula::parse(text, &names()).expect_err(text);
    (fault.column(text), fault.problem)
}

#[track_caller]
fn assert_fault(text: &str, column: usize, parts: &[&str]) {
    let (found, problem) = fault(text);
    assert_eq!(found, column, "{text}: {problem}");
    for part in parts {
        assert!(problem.contains(part), "{text}: {problem}");
    }
}

#[test]
fn operators_bind_as_written_on_paper() {
    for (text, expected) in [
        ("1 + 2 * x", 7.0),
        ("(1 + 2) * x", 9.0),
        ("10 - 4 - x", 3.0),
        ("24 / 4 / x", 2.0),
        ("24 / (4 / 2)", 12.0),
        ("-x^2", -9.0),
        ("(-x)^2", 9.0),
        ("-2^2", -4.0),
        ("x^-1 * 3", 1.0),
        ("2^3^2", 512.0),
        ("(2^3)^2", 64.0),
        ("x^(1 + 1)", 9.0),
        ("x^2^0.5^0", 9.0),
        ("2 - -x", 5.0),
        ("--x", 3.0),
        ("-x * y", 6.0),
        ("x * -y", 6.0),
        ("2 * x^2 * 2", 36.0),
        ("-x + 1", -2.0),
        ("1e1 + .5 + 2.", 12.5),
        ("1.5e-1 * 10", 1.5),
        ("out[1] - out[0]", 10.0),
    ] {
        assert!((value(text) - expected).abs() < 1e-6, "{text} = {}", value(text));
    }
}

#[test]
fn conditions_choose() {
    for (condition, expected) in [
        ("x < 3", 2.0),
        ("x <= 3", 1.0),
        ("x > 3", 2.0),
        ("x >= 3", 1.0),
        ("x == 3", 1.0),
        ("x != 3", 2.0),
        ("y < 0", 1.0),
        ("0 > y", 1.0),
        ("y == 3", 2.0),
        ("y != 3", 1.0),
        ("x == y", 2.0),
        ("x != y", 1.0),
        ("y >= x", 2.0),
        ("y <= x", 1.0),
    ] {
        assert_eq!(value(&format!("if({condition}, 1, 2)")), expected, "{condition}");
    }
}

/// Every function against the platform's, in f64, within what its stand-ins reach.
#[test]
fn functions_are_those_of_their_names() {
    for (text, expected) in [
        ("abs(y)", 2.0),
        ("min(x, y)", -2.0),
        ("max(x, y)", 3.0),
        ("clamp(x, y, 1)", 1.0),
        ("clamp(y, -1, 1)", -1.0),
        ("sqrt(x)", 3.0_f64.sqrt()),
        ("hypot(x, y)", 13.0_f64.sqrt()),
        ("floor(-2.5)", -3.0),
        ("sign(y)", -1.0),
        ("sign(x - 3)", 0.0),
        ("sin(x)", 3.0_f64.sin()),
        ("cos(x)", 3.0_f64.cos()),
        ("tan(x)", 3.0_f64.tan()),
        ("asin(heading)", 0.5_f64.asin()),
        ("acos(-heading)", (-0.5_f64).acos()),
        ("atan(y)", (-2.0_f64).atan()),
        ("atan2(y, x)", (-2.0_f64).atan2(3.0)),
        ("atan2(x, y)", 3.0_f64.atan2(-2.0)),
        ("exp(y)", (-2.0_f64).exp()),
        ("exp(x)", 3.0_f64.exp()),
        ("log(x)", 3.0_f64.ln()),
        ("tanh(y)", (-2.0_f64).tanh()),
        ("sigmoid(y)", 1.0 / (1.0 + 2.0_f64.exp())),
        ("wrap(x + 1)", 4.0 - std::f64::consts::TAU),
        ("x^2.5", 3.0_f64.powf(2.5)),
        ("pi", f64::from(std::f32::consts::PI)),
    ] {
        let found = value(text);
        assert!((found - expected).abs() < 1e-6 * expected.abs().max(1.0), "{text} = {found}");
    }
}

/// A literal is rounded to f32 once, whatever is computed with it; too large a one is infinite.
#[test]
fn literals_are_f32() {
    assert_eq!(value("0.1"), f64::from(0.1_f32));
    // Between two f32, above the middle by less than an f64 can tell: rounded once, it goes up.
    assert_eq!(value("1.00000005960464477540"), f64::from(1.000_000_1_f32));
    assert_eq!(value("1e39"), f64::INFINITY);
    assert_eq!(value("-1e99"), f64::NEG_INFINITY);
}

#[test]
fn faults_say_where_and_what() {
    assert_fault("1 + hedaing", 5, &["unknown name `hedaing`", "nearest is `heading`"]);
    assert_fault("cosh(x)", 1, &["unknown function `cosh`", "nearest is `cos`"]);
    assert_fault("x + sin x", 5, &["`sin` is a function", "`sin(...)`"]);
    assert_fault("2 * x(3)", 5, &["`x` is no function"]);
    assert_fault("hypot(x)", 1, &["`hypot` takes 2 arguments, found 1"]);
    assert_fault("1 + abs()", 5, &["`abs` takes 1 argument, found 0"]);
    assert_fault("clamp(x, y)", 1, &["takes 3 arguments, found 2"]);
    assert_fault("x^y", 3, &["an exponent is a number"]);
    assert_fault("2^(x + 1)", 3, &["an exponent is a number"]);
    assert_fault("x^1e39", 3, &["the exponent is inf"]);
    assert_fault("x + log(-1)", 5, &["`log` of -1 is not a number"]);
    assert_fault("log(1 - 1)", 1, &["`log` of 0"]);
    assert_fault("sqrt(-2)", 1, &["`sqrt` of -2"]);
    assert_fault("acos(pi)", 1, &["`acos` of 3.14"]);
    assert_fault("x +", 4, &["expected a number, a name or `(`", "found the end"]);
    assert_fault("(x + 1", 7, &["expected `)`", "found the end"]);
    assert_fault("x + 1)", 6, &["expected an operator or the end", "found `)`"]);
    assert_fault("2 x", 3, &["expected an operator", "the name `x`"]);
    assert_fault("x ** 2", 3, &["found `**`", "`^`"]);
    assert_fault("x < 1", 3, &["`<` stands outside a condition"]);
    assert_fault("if(x, 1, 2)", 5, &["expected a comparison", "found `,`"]);
    assert_fault("if(x = 1, 1, 2)", 6, &["expected a comparison", "`==`"]);
    assert_fault("if(x < 1, 2)", 12, &["expected `,`", "found `)`"]);
    assert_fault("x + $", 5, &["`$` has no meaning"]);
    assert_fault("\u{1b}[31m", 1, &["`\\u{1b}` has no meaning"]);
    assert_fault("x + é", 5, &["`é` has no meaning"]);
    assert_fault("'é' + x", 1, &["expected a number", "the text 'é'"]);
    assert_fault("'file", 1, &["no closing '"]);
    assert_fault(".", 1, &["`.` without digits"]);
    assert_fault("out[x]", 5, &["the number of an output"]);
    assert_fault("net(x)", 5, &["the file of a network between quotes"]);
    assert_fault("t", 1, &["needs `period`"]);
    assert_fault("", 1, &["found the end"]);
    assert_fault(&"a".repeat(65), 1, &["has 65 characters, at most 64"]);
}

#[test]
fn names_are_refused_where_they_would_be_taken_for_something_else() {
    for (name, part) in [
        ("sin", "name of a function"),
        ("if", "name of a function"),
        ("net", "name of a function"),
        ("t", "time in seconds"),
        ("step", "number of the step"),
        ("pi", "number pi"),
        ("out", "outputs"),
        ("2x", "does not begin with a digit"),
        ("ego-x", "letters, digits and `_`"),
        ("", "letters"),
        ("x", "is a state already"),
    ] {
        let problem = names().add(name, "a parameter").expect_err(name);
        assert!(problem.contains(part), "{name}: {problem}");
    }
}

/// Deep, long and wide texts are refused with the figure, or read, in no time.
#[test]
fn limits_hold_and_cost_nothing() {
    let begin = Instant::now();
    let deep = |count: usize| format!("{}x{}", "(".repeat(count), ")".repeat(count));
    assert_eq!(value(&deep(255)), 3.0);
    for text in [deep(256), deep(10_000), "-".repeat(10_000) + "x", "2^".repeat(10_000) + "2"] {
        assert!(fault(&text).1.contains("nested deeper than 256"), "{}", fault(&text).1);
    }
    let calls = format!("{}x{}", "abs(".repeat(10_000), ")".repeat(10_000));
    assert!(fault(&calls).1.contains("nested deeper than 256"));
    assert!(fault(&"x+".repeat(5_000_000)).1.contains("10000000 bytes, at most 1048576"));
    // 65,535 operations: names and the sums between them.
    let sum = |count: usize| vec!["x"; count].join("+");
    assert_eq!(value(&sum(32_768)), 98_304.0);
    assert!(fault(&sum(32_769)).1.contains("more than 65536 operations"));
    assert!(fault(&"y".repeat(1 << 20)).1.contains("has 1048576 characters"));
    assert!(Formula::parse(&format!("0.{}", "1".repeat(1_000_000)), &names()).is_ok());
    assert!(begin.elapsed() < Duration::from_secs(5), "{:?}", begin.elapsed());
}

#[test]
fn every_function_knows_its_name() {
    for name in Function::names().filter(|name| !["if", "net"].contains(name)) {
        let function = Function::named(name).expect(name);
        assert_eq!(function.name(), name);
        let arguments = vec!["x"; function.arguments()].join(", ");
        Formula::parse(&format!("{name}({arguments})"), &names()).expect(name);
    }
}

/// Words of the grammar.
const WORDS: [&str; 28] = [
    "x", "y", "heading", "1", "2.5", "1e9", "+", "-", "*", "/", "^", "(", ")", ",", "<", "==", "[",
    "]", "if(", "sin(", "hypot(", "clamp(", "net(", "'a'", "out[", "0", " ", "pi",
];

/// Texts made of the words of the grammar, and of anything.
fn texts() -> impl Strategy<Value = String> {
    let made = proptest::collection::vec(proptest::sample::select(&WORDS[..]), 0..40);
    prop_oneof![made.prop_map(|words| words.concat()), ".{0,60}"]
}

proptest! {
    /// No text panics; what is read has a value, what is refused a column within it.
    #[test]
    fn no_text_panics(text in texts()) {
        match Formula::parse(&text, &names()) {
            Ok(formula) if formula.networks().is_empty() && formula.outputs().next().is_none() => {
                let networks = Networks::default();
                let names = &[3.0_f32, -2.0, 0.5];
                formula.value(Values { names, outputs: &[], looked: &[], networks: &networks });
            }
            Ok(_) => {}
            Err(fault) => prop_assert!(fault.column(&text) <= text.chars().count() + 1),
        }
    }

    /// Sums, products and powers in one line against the same in Rust.
    #[test]
    fn chains_are_what_they_are_without_a_grammar(a in -9..9_i32, b in -9..9_i32, c in 1..9_i32) {
        let plain = format!("{a} - {b} * {c} - {a} / {c} ^ 2");
        let (a, b, c) = (f64::from(a), f64::from(b), f64::from(c));
        let expected = a - b * c - a / (c * c);
        prop_assert!((value(&plain) - expected).abs() < 1e-9, "{plain}");
    }
}
