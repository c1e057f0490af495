//! Formulas of attributes: numbers, names, + - * / and parentheses.

use std::iter::Peekable;
use std::str::Chars;

/// Deepest parentheses and signs.
const DEEPEST: u32 = 64;

/// A formula as steps of a machine with a stack; names are replaced by what they are found to be.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Formula<Name>(Vec<Step<Name>>);

#[derive(Clone, Debug, PartialEq)]
enum Step<Name> {
    Number(f64),
    Value(Name),
    Negate,
    Add,
    Subtract,
    Multiply,
    Divide,
}

impl Formula<String> {
    /// Reads a formula.
    pub(super) fn parse(text: &str) -> Result<Self, String> {
        let mut reader = Reader { text: text.chars().peekable(), steps: Vec::new(), depth: 0 };
        reader.sum()?;
        match reader.next() {
            None => Ok(Self(reader.steps)),
            Some(odd) => Err(format!("{odd:?} is not expected in the formula {text:?}")),
        }
    }

    /// The same with what its names stand for.
    pub(super) fn resolve<Name, E>(
        &self,
        mut find: impl FnMut(&str) -> Result<Name, E>,
    ) -> Result<Formula<Name>, E> {
        let mut step = |step: &Step<String>| -> Result<_, E> {
            Ok(match step {
                Step::Number(number) => Step::Number(*number),
                Step::Value(name) => Step::Value(find(name)?),
                Step::Negate => Step::Negate,
                Step::Add => Step::Add,
                Step::Subtract => Step::Subtract,
                Step::Multiply => Step::Multiply,
                Step::Divide => Step::Divide,
            })
        };
        self.0.iter().map(&mut step).collect::<Result<_, E>>().map(Formula)
    }
}

impl<Name> Formula<Name> {
    /// Computes it in doubles.
    ///
    /// # Errors
    /// Values that are none, a division by zero, numbers that are too large.
    pub(super) fn compute(
        &self,
        stack: &mut Vec<f64>,
        value: impl Fn(&Name) -> Result<f64, String>,
    ) -> Result<f64, String> {
        stack.clear();
        for step in &self.0 {
            let result = match step {
                Step::Number(number) => *number,
                Step::Value(name) => value(name)?,
                Step::Negate => -pop(stack),
                Step::Add => pop(stack) + pop(stack),
                Step::Multiply => pop(stack) * pop(stack),
                Step::Subtract => -pop(stack) + pop(stack),
                Step::Divide => {
                    let by = pop(stack);
                    if by == 0.0 {
                        return Err("a division by zero".to_owned());
                    }
                    pop(stack) / by
                }
            };
            if !result.is_finite() {
                return Err("a number too large".to_owned());
            }
            stack.push(result);
        }
        Ok(pop(stack))
    }
}

/// The last number; a formula that was read leaves none out.
fn pop(stack: &mut Vec<f64>) -> f64 {
    stack.pop().unwrap_or(f64::NAN)
}

/// Reads text from left to right.
struct Reader<'a> {
    text: Peekable<Chars<'a>>,
    steps: Vec<Step<String>>,
    depth: u32,
}

impl Reader<'_> {
    /// The next character that is no space.
    fn peek(&mut self) -> Option<char> {
        while self.text.next_if(|c| c.is_whitespace()).is_some() {}
        self.text.peek().copied()
    }

    fn next(&mut self) -> Option<char> {
        self.peek();
        self.text.next()
    }

    fn sum(&mut self) -> Result<(), String> {
        self.product()?;
        while let Some(sign @ ('+' | '-')) = self.peek() {
            self.next();
            self.product()?;
            self.steps.push(if sign == '+' { Step::Add } else { Step::Subtract });
        }
        Ok(())
    }

    fn product(&mut self) -> Result<(), String> {
        self.factor()?;
        while let Some(sign @ ('*' | '/')) = self.peek() {
            self.next();
            self.factor()?;
            self.steps.push(if sign == '*' { Step::Multiply } else { Step::Divide });
        }
        Ok(())
    }

    fn factor(&mut self) -> Result<(), String> {
        self.depth += 1;
        if self.depth > DEEPEST {
            return Err(format!("the formula is more than {DEEPEST} parentheses deep"));
        }
        match self.next() {
            Some('-') => {
                self.factor()?;
                self.steps.push(Step::Negate);
            }
            Some('(') => {
                self.sum()?;
                if self.next() != Some(')') {
                    return Err("a parenthesis is not closed in the formula".to_owned());
                }
            }
            Some('"') => {
                let name: String =
                    std::iter::from_fn(|| self.text.next_if(|c| *c != '"')).collect();
                if self.text.next().is_none() {
                    return Err("a quotation mark is not closed in the formula".to_owned());
                }
                self.steps.push(Step::Value(name));
            }
            Some(first) if first.is_ascii_digit() || first == '.' => self.number(first)?,
            Some(first) if first.is_alphabetic() || first == '_' => {
                let rest = std::iter::from_fn(|| self.text.next_if(|c| is_of_name(*c)));
                let name = std::iter::once(first).chain(rest).collect();
                self.steps.push(Step::Value(name));
            }
            Some(odd) => return Err(format!("{odd:?} is not expected in the formula")),
            None => return Err("the formula ends where a number or name is expected".to_owned()),
        }
        self.depth -= 1;
        Ok(())
    }

    fn number(&mut self, first: char) -> Result<(), String> {
        let mut text = String::from(first);
        loop {
            let is_exponent = text.ends_with(['e', 'E']);
            let is_part = |c: &char| {
                c.is_ascii_alphanumeric() || *c == '.' || is_exponent && matches!(c, '+' | '-')
            };
            let Some(next) = self.text.next_if(is_part) else { break };
            text.push(next);
        }
        let number = text.parse().ok().filter(|number: &f64| number.is_finite());
        self.steps.push(Step::Number(number.ok_or_else(|| format!("{text} is no number"))?));
        Ok(())
    }
}

fn is_of_name(c: char) -> bool {
    c.is_alphanumeric() || matches!(c, '_' | '[' | ']')
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn compute(text: &str) -> Result<f64, String> {
        let value = |name: &String| match name.as_str() {
            "a" => Ok(3.0),
            "a b[1]" => Ok(7.0),
            "zero" => Ok(0.0),
            _ => Err(format!("no {name}")),
        };
        Formula::parse(text)?.compute(&mut Vec::new(), value)
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
    fn what_is_no_formula_or_no_number_is_told() {
        let deep = "(".repeat(10_000) + "1";
        let signs = "-".repeat(10_000) + "1";
        for (text, told) in [
            ("", "ends where"),
            ("1+", "ends where"),
            ("(1", "not closed"),
            ("\"a", "not closed"),
            ("1)", "')' is not expected"),
            ("1 2", "'2' is not expected"),
            ("a=2", "'=' is not expected"),
            ("*2", "'*' is not expected"),
            ("1.2.3", "no number"),
            ("1e999", "no number"),
            ("0x10", "no number"),
            ("1/zero", "division by zero"),
            ("1/(a-3)", "division by zero"),
            ("1e300*1e300", "too large"),
            ("1/(1e300*1e300)", "too large"),
            ("b", "no b"),
            (&deep, "parentheses deep"),
            (&signs, "parentheses deep"),
        ] {
            let error = compute(text).unwrap_err();
            assert!(error.contains(told), "{text}: {error}");
        }
    }

    proptest! {
        #[test]
        fn no_text_makes_it_panic(text in "[-+*/()a1.e\" ]{0,40}") {
            let _ = compute(&text);
        }

        /// Beside the same written with all its parentheses.
        #[test]
        fn products_come_before_sums(numbers in prop::collection::vec(1..9_i32, 4), signs in prop::collection::vec(0..4_usize, 3)) {
            let sign = |i: usize| ['+', '-', '*', '/'][signs[i]];
            let plain = format!("{}{}{}{}{}{}{}", numbers[0], sign(0), numbers[1], sign(1), numbers[2], sign(2), numbers[3]);
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
}
