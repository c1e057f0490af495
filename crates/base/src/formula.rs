//! Expressions over named numbers: formulas (`intensity / 256`) and conditions
//! (`intensity > 100 and point_source_id in (7, 9)`), read by one parser.
//!
//! ```text
//! condition   = conjunction { ("or" | "||") conjunction }
//! conjunction = negation { ("and" | "&&") negation }
//! negation    = ("not" | "!") negation | comparison
//! comparison  = sum [ ("=" | "==" | "!=" | "<>" | "<" | "<=" | ">" | ">=") sum
//!                   | ["not"] "in" "(" sum { "," sum } ")" ]
//! sum         = product { ("+" | "-") product }
//! product     = factor { ("*" | "/") factor }
//! factor      = "-" factor | "(" condition ")" | number | name | '"' name '"'
//! ```

use std::convert::Infallible;

/// Deepest parentheses, signs and negations.
const DEEPEST: u32 = 64;
/// Most steps of an expression.
const MOST_STEPS: usize = 4096;
/// What a condition computes.
const TRUE: f64 = 1.0;
const FALSE: f64 = 0.0;
/// Words that are no names unless they are quoted.
const WORDS: [&str; 4] = ["and", "or", "not", "in"];

/// An expression as steps of a stack machine; its names are of any type once they are resolved.
#[derive(Clone, Debug, PartialEq)]
pub struct Formula<Name>(Vec<FormulaStep<Name>>);

#[derive(Clone, Debug, PartialEq)]
enum FormulaStep<Name> {
    Number(f64),
    Value(Name),
    Negate,
    Add,
    Subtract,
    Multiply,
    Divide,
    Compare(ComparisonOperator),
    /// Whether one of so many numbers equals the one before them.
    In(usize),
    And,
    Or,
    Not,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum ComparisonOperator {
    Equal,
    Unequal,
    Less,
    LessOrEqual,
    Greater,
    GreaterOrEqual,
}

/// Comparisons by their signs, longer signs before those that they begin with.
const COMPARISONS: [(&str, ComparisonOperator); 8] = [
    ("==", ComparisonOperator::Equal),
    ("!=", ComparisonOperator::Unequal),
    ("<>", ComparisonOperator::Unequal),
    ("<=", ComparisonOperator::LessOrEqual),
    (">=", ComparisonOperator::GreaterOrEqual),
    ("=", ComparisonOperator::Equal),
    ("<", ComparisonOperator::Less),
    (">", ComparisonOperator::Greater),
];

/// What a part of an expression computes.
#[derive(Clone, Copy, Debug, PartialEq)]
enum FormulaType {
    Number,
    Truth,
}

impl Formula<String> {
    /// Parses a formula, which computes a number.
    ///
    /// # Errors
    /// Text that is no formula, or a condition.
    pub fn number(text: &str) -> Result<Self, String> {
        match parse(text)? {
            (formula, FormulaType::Number) => Ok(formula),
            (_, FormulaType::Truth) => Err(format!("{text:?} is a condition, not a number")),
        }
    }

    /// Parses a condition, which is true or not.
    ///
    /// # Errors
    /// Text that is no condition, or a number.
    pub fn condition(text: &str) -> Result<Self, String> {
        match parse(text)? {
            (formula, FormulaType::Truth) => Ok(formula),
            (_, FormulaType::Number) => Err(format!(
                "{text:?} compares nothing: write a condition, such as intensity > 100"
            )),
        }
    }

    /// The same expression with `find` applied to each name.
    ///
    /// # Errors
    /// Those of `find`.
    pub fn resolve<Name, E>(
        &self,
        mut find: impl FnMut(&str) -> Result<Name, E>,
    ) -> Result<Formula<Name>, E> {
        let mut step = |step: &FormulaStep<String>| -> Result<_, E> {
            Ok(match step {
                FormulaStep::Number(number) => FormulaStep::Number(*number),
                FormulaStep::Value(name) => FormulaStep::Value(find(name)?),
                FormulaStep::Negate => FormulaStep::Negate,
                FormulaStep::Add => FormulaStep::Add,
                FormulaStep::Subtract => FormulaStep::Subtract,
                FormulaStep::Multiply => FormulaStep::Multiply,
                FormulaStep::Divide => FormulaStep::Divide,
                FormulaStep::Compare(how) => FormulaStep::Compare(*how),
                FormulaStep::In(count) => FormulaStep::In(*count),
                FormulaStep::And => FormulaStep::And,
                FormulaStep::Or => FormulaStep::Or,
                FormulaStep::Not => FormulaStep::Not,
            })
        };
        self.0.iter().map(&mut step).collect::<Result<_, E>>().map(Formula)
    }
}

impl<Name> Formula<Name> {
    /// Computes the number in double precision.
    ///
    /// # Errors
    /// Those of `value`, a division by zero, numbers that are too large.
    pub fn compute(
        &self,
        stack: &mut Vec<f64>,
        value: impl Fn(&Name) -> Result<f64, String>,
    ) -> Result<f64, String> {
        self.run(stack, value, |found| found.map_err(str::to_owned))
    }

    /// Whether the condition is true. As in SQL, what is computed from a missing value (NaN) or by a
    /// division by zero is neither true nor false.
    pub fn holds(&self, stack: &mut Vec<f64>, value: impl Fn(&Name) -> f64) -> bool {
        let value = |name: &Name| Ok::<_, Infallible>(value(name));
        let Ok(found) = self.run(stack, value, |found| Ok(found.unwrap_or(f64::NAN)));
        found == TRUE
    }

    fn run<E>(
        &self,
        stack: &mut Vec<f64>,
        value: impl Fn(&Name) -> Result<f64, E>,
        settle: impl Fn(Result<f64, &'static str>) -> Result<f64, E>,
    ) -> Result<f64, E> {
        stack.clear();
        for step in &self.0 {
            let result = match step {
                FormulaStep::Number(number) => *number,
                FormulaStep::Value(name) => value(name)?,
                other => settle(other.apply(stack))?,
            };
            stack.push(result);
        }
        Ok(pop(stack))
    }
}

impl<Name> FormulaStep<Name> {
    /// Replaces the operands of an operator by its result.
    fn apply(&self, stack: &mut Vec<f64>) -> Result<f64, &'static str> {
        let mut last = || pop(stack);
        let result = match self {
            Self::Negate => -last(),
            Self::Add => last() + last(),
            Self::Multiply => last() * last(),
            // The operand on the right comes off the stack first.
            Self::Subtract => -last() + last(),
            Self::Divide => match (last(), last()) {
                (0.0, _) => return Err("a division by zero"),
                (by, number) => number / by,
            },
            Self::Compare(how) => {
                let (right, left) = (last(), last());
                return Ok(truth(how.holds(left, right), left.is_nan() || right.is_nan()));
            }
            Self::In(count) => {
                let all: Vec<f64> = (0..*count).map(|_| last()).collect();
                let number = last();
                let is_unknown = number.is_nan() || all.iter().any(|one| one.is_nan());
                let is_in = all.contains(&number);
                return Ok(truth(is_in, is_unknown && !is_in));
            }
            // Of truths the least is their conjunction, and NaN lies between false and true.
            Self::And => return Ok(least(last(), last())),
            Self::Or => return Ok(TRUE - least(TRUE - last(), TRUE - last())),
            Self::Not => return Ok(TRUE - last()),
            Self::Number(_) | Self::Value(_) => f64::NAN,
        };
        if result.is_finite() { Ok(result) } else { Err("a number too large") }
    }
}

impl ComparisonOperator {
    fn holds(self, left: f64, right: f64) -> bool {
        match self {
            Self::Equal => left == right,
            Self::Unequal => left != right,
            Self::Less => left < right,
            Self::LessOrEqual => left <= right,
            Self::Greater => left > right,
            Self::GreaterOrEqual => left >= right,
        }
    }
}

fn truth(is_true: bool, is_unknown: bool) -> f64 {
    match (is_unknown, is_true) {
        (true, _) => f64::NAN,
        (false, true) => TRUE,
        (false, false) => FALSE,
    }
}

/// The conjunction of two truths.
fn least(a: f64, b: f64) -> f64 {
    if a == FALSE || b == FALSE { FALSE } else { a * b }
}

/// The last number; an expression that was parsed leaves none out.
fn pop(stack: &mut Vec<f64>) -> f64 {
    stack.pop().unwrap_or(f64::NAN)
}

fn parse(text: &str) -> Result<(Formula<String>, FormulaType), String> {
    let mut parser = FormulaParser { rest: text, steps: Vec::new(), depth: 0 };
    let kind = parser.condition()?;
    match parser.peek() {
        None => Ok((Formula(parser.steps), kind)),
        Some(odd) => Err(format!("{odd:?} is not expected in the formula {text:?}")),
    }
}

/// Parses text from left to right.
struct FormulaParser<'a> {
    rest: &'a str,
    steps: Vec<FormulaStep<String>>,
    depth: u32,
}

impl FormulaParser<'_> {
    /// The next character that is not white space.
    fn peek(&mut self) -> Option<char> {
        self.rest = self.rest.trim_start();
        self.rest.chars().next()
    }

    /// Takes a sign if it comes next.
    fn sign(&mut self, sign: &str) -> bool {
        self.peek();
        let rest = self.rest.strip_prefix(sign);
        self.rest = rest.unwrap_or(self.rest);
        rest.is_some()
    }

    /// Takes a word if it comes next, letter case aside.
    fn word(&mut self, word: &str) -> bool {
        self.peek();
        let (name, rest) = split(self.rest, is_of_name);
        let is_it = name.eq_ignore_ascii_case(word);
        if is_it {
            self.rest = rest;
        }
        is_it
    }

    /// Adds a step.
    fn push(
        &mut self,
        step: FormulaStep<String>,
        kind: FormulaType,
    ) -> Result<FormulaType, String> {
        if self.steps.len() == MOST_STEPS {
            return Err(format!("the formula has more than {MOST_STEPS} steps"));
        }
        self.steps.push(step);
        Ok(kind)
    }

    fn condition(&mut self) -> Result<FormulaType, String> {
        let mut kind = self.conjunction()?;
        while self.word("or") || self.sign("||") {
            is(FormulaType::Truth, kind)?;
            is(FormulaType::Truth, self.conjunction()?)?;
            kind = self.push(FormulaStep::Or, FormulaType::Truth)?;
        }
        Ok(kind)
    }

    fn conjunction(&mut self) -> Result<FormulaType, String> {
        let mut kind = self.negation()?;
        while self.word("and") || self.sign("&&") {
            is(FormulaType::Truth, kind)?;
            is(FormulaType::Truth, self.negation()?)?;
            kind = self.push(FormulaStep::And, FormulaType::Truth)?;
        }
        Ok(kind)
    }

    fn negation(&mut self) -> Result<FormulaType, String> {
        if !self.word("not") && !self.sign("!") {
            return self.comparison();
        }
        self.deeper(|parser| is(FormulaType::Truth, parser.negation()?))?;
        self.push(FormulaStep::Not, FormulaType::Truth)
    }

    fn comparison(&mut self) -> Result<FormulaType, String> {
        let kind = self.sum()?;
        if let Some(how) = self.compared() {
            is(FormulaType::Number, kind)?;
            is(FormulaType::Number, self.sum()?)?;
            if self.compared().is_some() {
                return Err("comparisons are joined by and: 1 < z and z < 5".to_owned());
            }
            return self.push(FormulaStep::Compare(how), FormulaType::Truth);
        }
        let is_not = self.word("not");
        if !self.word("in") {
            return if is_not { Err("in is expected behind not".to_owned()) } else { Ok(kind) };
        }
        is(FormulaType::Number, kind)?;
        let count = self.list()?;
        self.push(FormulaStep::In(count), FormulaType::Truth)?;
        if is_not {
            self.push(FormulaStep::Not, FormulaType::Truth)
        } else {
            Ok(FormulaType::Truth)
        }
    }

    /// The comparison whose sign comes next.
    fn compared(&mut self) -> Option<ComparisonOperator> {
        let (_, how) = COMPARISONS.into_iter().find(|(sign, _)| self.sign(sign))?;
        Some(how)
    }

    /// Numbers in parentheses; returns how many.
    fn list(&mut self) -> Result<usize, String> {
        if !self.sign("(") {
            return Err("a list in parentheses is expected behind in".to_owned());
        }
        let mut count = 0;
        loop {
            is(FormulaType::Number, self.deeper(Self::sum)?)?;
            count += 1;
            match (self.sign(","), self.sign(")")) {
                (true, false) => {}
                (false, true) => return Ok(count),
                _ => return Err("the list behind in is not closed".to_owned()),
            }
        }
    }

    fn sum(&mut self) -> Result<FormulaType, String> {
        let mut kind = self.product()?;
        while let Some(sign @ ('+' | '-')) = self.peek() {
            self.rest = &self.rest[1..];
            is(FormulaType::Number, kind)?;
            is(FormulaType::Number, self.product()?)?;
            let step = if sign == '+' { FormulaStep::Add } else { FormulaStep::Subtract };
            kind = self.push(step, FormulaType::Number)?;
        }
        Ok(kind)
    }

    fn product(&mut self) -> Result<FormulaType, String> {
        let mut kind = self.factor()?;
        while let Some(sign @ ('*' | '/')) = self.peek() {
            self.rest = &self.rest[1..];
            is(FormulaType::Number, kind)?;
            is(FormulaType::Number, self.factor()?)?;
            let step = if sign == '*' { FormulaStep::Multiply } else { FormulaStep::Divide };
            kind = self.push(step, FormulaType::Number)?;
        }
        Ok(kind)
    }

    fn deeper<T>(
        &mut self,
        parse: impl FnOnce(&mut Self) -> Result<T, String>,
    ) -> Result<T, String> {
        self.depth += 1;
        if self.depth > DEEPEST {
            return Err(format!("the formula is more than {DEEPEST} parentheses deep"));
        }
        let parsed = parse(self);
        self.depth -= 1;
        parsed
    }

    fn factor(&mut self) -> Result<FormulaType, String> {
        match self.peek() {
            Some('-') => {
                self.rest = &self.rest[1..];
                is(FormulaType::Number, self.deeper(Self::factor)?)?;
                self.push(FormulaStep::Negate, FormulaType::Number)
            }
            Some('(') => {
                self.rest = &self.rest[1..];
                let kind = self.deeper(Self::condition)?;
                match self.sign(")") {
                    true => Ok(kind),
                    false => Err("a parenthesis is not closed in the formula".to_owned()),
                }
            }
            Some('"') => {
                let quoted = self.rest[1..].split_once('"');
                let (name, rest) = quoted.ok_or("a quotation mark is not closed in the formula")?;
                self.rest = rest;
                self.push(FormulaStep::Value(name.to_owned()), FormulaType::Number)
            }
            Some(first) if first.is_ascii_digit() || first == '.' => self.literal(),
            Some(first) if first.is_alphabetic() || first == '_' => {
                let (name, rest) = split(self.rest, is_of_name);
                if WORDS.iter().any(|word| word.eq_ignore_ascii_case(name)) {
                    return Err(format!("{name} is not expected here in the formula"));
                }
                self.rest = rest;
                self.push(FormulaStep::Value(name.to_owned()), FormulaType::Number)
            }
            Some(odd) => Err(format!("{odd:?} is not expected in the formula")),
            None => Err("the formula ends where a number or name is expected".to_owned()),
        }
    }

    fn literal(&mut self) -> Result<FormulaType, String> {
        let mut is_exponent = false;
        let (text, rest) = split(self.rest, |c| {
            let is_part = c.is_ascii_alphanumeric() || c == '.' || is_exponent && "+-".contains(c);
            is_exponent = matches!(c, 'e' | 'E');
            is_part
        });
        self.rest = rest;
        let number = text.parse().ok().filter(|number: &f64| number.is_finite());
        let number = number.ok_or_else(|| format!("{text} is not a number"))?;
        self.push(FormulaStep::Number(number), FormulaType::Number)
    }
}

/// Fails when a part of an expression is not of the kind that is wanted.
fn is(wanted: FormulaType, found: FormulaType) -> Result<FormulaType, String> {
    match (wanted, found) {
        (FormulaType::Truth, FormulaType::Number) => {
            Err("and, or and not join conditions, such as intensity > 100".to_owned())
        }
        (FormulaType::Number, FormulaType::Truth) => {
            Err("a condition stands where a number is expected".to_owned())
        }
        _ => Ok(found),
    }
}

/// What text begins with that `is_part`, and the rest.
fn split(text: &str, mut is_part: impl FnMut(char) -> bool) -> (&str, &str) {
    text.split_at(text.find(|c| !is_part(c)).unwrap_or(text.len()))
}

fn is_of_name(c: char) -> bool {
    c.is_alphanumeric() || matches!(c, '_' | '[' | ']')
}

#[cfg(test)]
mod tests;
