//! Expressions beside what they mean, written out.

use super::*;
use proptest::prelude::*;

fn value(name: &str) -> Option<f64> {
    match name {
        "a" => Some(3.0),
        "a b[1]" => Some(7.0),
        "zero" => Some(0.0),
        "none" => Some(f64::NAN),
        _ => None,
    }
}

fn compute(text: &str) -> Result<f64, String> {
    let value = |name: &String| value(name).ok_or_else(|| format!("no {name}"));
    Formula::number(text)?.compute(&mut Vec::new(), value)
}

fn holds(text: &str) -> Result<bool, String> {
    let value = |name: &str| value(name).ok_or_else(|| format!("no {name}"));
    let condition = Formula::condition(text)?.resolve(value)?;
    Ok(condition.holds(&mut Vec::new(), |number| *number))
}

#[test]
fn formulas_are_computed_as_they_are_written() {
    for (text, value) in [
        ("1", 1.0),
        (" 1 + 2*3 ", 7.0),
        ("(1+2)*3", 9.0),
        ("8-3-2", 3.0),
        ("8/2/2", 2.0),
        ("-a*-2", 6.0),
        ("2--1", 3.0),
        ("1e2-.5", 99.5),
        ("1.5e-1*2", 0.3),
        ("\"a b[1]\"+a", 10.0),
        ("zero/a", 0.0),
    ] {
        assert_eq!(compute(text), Ok(value), "{text}");
    }
}

#[test]
fn conditions_hold_as_they_are_written() {
    for (text, expected) in [
        ("a = 3", true),
        ("a == 3 and a<>4", true),
        ("a != 3", false),
        ("a>2&&a<4", true),
        ("a >= 3 AND a <= 3", true),
        ("1 + 1 < a * 2 - 3", true),
        ("a > 5 or a < 4 and zero = 1", false),
        ("(a > 5 or a < 4) and zero = 0", true),
        ("not a = 3 or zero = 0", true),
        ("not (a = 3 or zero = 0)", false),
        ("!(a = 4)", true),
        ("!a = 4", true),
        ("not not a = 3", true),
        ("a in (1, 2, 1+2)", true),
        ("a in (1)", false),
        ("a not in (1, 2)", true),
        ("\"a b[1]\" in (7)", true),
        ("((a = 3))", true),
        ("(a) = (3)", true),
        ("-a < -2", true),
        // Missing values are neither true nor false.
        ("none = 3", false),
        ("none != 3", false),
        ("not none = 3", false),
        ("none in (1, 3)", false),
        ("none not in (1, 3)", false),
        ("a in (none, 3)", true),
        ("a not in (none, 4)", false),
        ("none = 3 or a = 3", true),
        ("not (none = 3 and a = 4)", true),
        ("not (none = 3 or a = 4)", false),
        ("a / zero > 1", false),
        ("not a / zero > 1", false),
        ("1e300 * 1e300 > 1", false),
    ] {
        assert_eq!(holds(text), Ok(expected), "{text}");
    }
}

#[test]
fn what_is_no_formula_or_no_number_is_told() {
    let deep = "(".repeat(10_000) + "1";
    let signs = "-".repeat(10_000) + "1";
    for (text, told) in [
        ("", "unexpected end"),
        ("1+", "unexpected end"),
        ("(1", "unclosed parenthesis"),
        ("\"a", "unclosed quotation mark"),
        ("1)", "unexpected ')'"),
        ("1 2", "unexpected '2'"),
        ("a=2", "is a condition"),
        ("(a=2)+1", "expected a number"),
        ("-(a=2)", "expected a number"),
        ("*2", "unexpected '*'"),
        ("1.2.3", "not a number"),
        ("1e999", "not a number"),
        ("0x10", "not a number"),
        ("1/zero", "division by zero"),
        ("1/(a-3)", "division by zero"),
        ("1e300*1e300", "numeric overflow"),
        ("1/(1e300*1e300)", "numeric overflow"),
        ("b", "no b"),
        (&deep, "levels deep"),
        (&signs, "levels deep"),
    ] {
        let error = compute(text).unwrap_err();
        assert!(error.contains(told), "{text}: {error}");
    }
}

#[test]
fn what_is_no_condition_is_told() {
    let negations = "not ".repeat(10_000) + "a = 1";
    let long = "a = 1 or ".repeat(10_000) + "a = 1";
    for (text, told) in [
        ("", "unexpected end"),
        ("a", "is not a condition"),
        ("a + 1", "is not a condition"),
        ("1 < a < 5", "chained comparisons"),
        ("a and a = 3", "must be conditions"),
        ("a = 3 and 1", "must be conditions"),
        ("not a", "must be conditions"),
        ("(a = 3) = 1", "expected a number"),
        ("(a = 3) in (1)", "expected a number"),
        ("a = 3 a = 3", "unexpected 'a'"),
        ("a = 3 and", "unexpected end"),
        ("a = and", "unexpected and"),
        ("a =< 3", "unexpected '<'"),
        ("a => 3", "unexpected '>'"),
        ("a in 3", "list in parentheses"),
        ("a in ()", "unexpected ')'"),
        ("a in (1", "not closed"),
        ("a in (1 2)", "not closed"),
        ("a not 3", "expected in after not"),
        ("a = 'x'", "unexpected '\\''"),
        ("b = 3", "no b"),
        (&negations, "levels deep"),
        (&long, "steps"),
    ] {
        let error = holds(text).unwrap_err();
        assert!(error.contains(told), "{text}: {error}");
    }
}

/// A condition as a tree: the naive twin of the steps.
#[derive(Clone, Debug)]
enum Tree {
    Compare(usize, i32, i32),
    And(Box<Tree>, Box<Tree>),
    Or(Box<Tree>, Box<Tree>),
    Not(Box<Tree>),
    In(i32, Vec<i32>),
}

const SIGNS: [&str; 6] = ["=", "!=", "<", "<=", ">", ">="];

impl Tree {
    fn text(&self) -> String {
        match self {
            Self::Compare(sign, a, b) => format!("{a} {} {b}", SIGNS[*sign]),
            Self::And(a, b) => format!("({}) and ({})", a.text(), b.text()),
            Self::Or(a, b) => format!("({}) or ({})", a.text(), b.text()),
            Self::Not(a) => format!("not ({})", a.text()),
            Self::In(a, all) => {
                let all: Vec<String> = all.iter().map(i32::to_string).collect();
                format!("{a} in ({})", all.join(", "))
            }
        }
    }

    fn holds(&self) -> bool {
        match self {
            Self::Compare(sign, a, b) => [a == b, a != b, a < b, a <= b, a > b, a >= b][*sign],
            Self::And(a, b) => a.holds() && b.holds(),
            Self::Or(a, b) => a.holds() || b.holds(),
            Self::Not(a) => !a.holds(),
            Self::In(a, all) => all.contains(a),
        }
    }
}

fn tree() -> impl Strategy<Value = Tree> {
    let number = || -3..4_i32;
    let leaf = prop_oneof![
        (0..6_usize, number(), number()).prop_map(|(sign, a, b)| Tree::Compare(sign, a, b)),
        (number(), prop::collection::vec(number(), 1..4)).prop_map(|(a, all)| Tree::In(a, all)),
    ];
    leaf.prop_recursive(5, 40, 2, |inner| {
        let two = || (inner.clone(), inner.clone());
        prop_oneof![
            two().prop_map(|(a, b)| Tree::And(a.into(), b.into())),
            two().prop_map(|(a, b)| Tree::Or(a.into(), b.into())),
            inner.clone().prop_map(|a| Tree::Not(a.into())),
        ]
    })
}

proptest! {
    #[test]
    fn no_text_makes_it_panic(text in "[-+*/()a1.e\"=<>!&|, \u{e4}not in and or]{0,40}") {
        let _ = compute(&text);
        let _ = holds(&text);
    }

    #[test]
    fn conditions_are_those_of_their_trees(tree in tree()) {
        prop_assert_eq!(holds(&tree.text()), Ok(tree.holds()), "{}", tree.text());
    }

    /// Beside the same written with all its parentheses.
    #[test]
    fn products_come_before_sums(
        numbers in prop::collection::vec(1..9_i32, 4),
        signs in prop::collection::vec(0..4_usize, 3),
    ) {
        let sign = |i: usize| ['+', '-', '*', '/'][signs[i]];
        let [a, b, c, d] = [0, 1, 2, 3].map(|i| numbers[i]);
        let plain = format!("{a}{}{b}{}{c}{}{d}", sign(0), sign(1), sign(2));
        // Terms of one sign after the other.
        let (mut sum, mut term, mut is_less) = (0.0, f64::from(numbers[0]), false);
        for i in 0..3 {
            let next = f64::from(numbers[i + 1]);
            match sign(i) {
                '*' => term *= next,
                '/' => term /= next,
                sign => {
                    sum += if is_less { -term } else { term };
                    (term, is_less) = (next, sign == '-');
                }
            }
        }
        sum += if is_less { -term } else { term };
        prop_assert!((compute(&plain).unwrap() - sum).abs() < 1e-12);
    }
}
