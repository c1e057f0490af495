//! Options as doors meet them: filled from JSON, checked by rules, told again.

use serde_json::{Value, json};
use terrane_options::{
    Choice, OptionArity, OptionCodec, OptionKind, OptionRange, OptionRule, Options, PlainCodec,
    changed, check, check_given, fill, noted, settled, to_map,
};

/// How the ground is looked at
#[derive(Clone, Copy, Debug, Default, PartialEq, Choice)]
enum Light {
    /// From one side
    #[default]
    OneSide,
    /// From [all](Light) sides.
    AllSides,
}

/// What a run may use
#[derive(Clone, Debug, PartialEq, Options)]
#[options(heading = "Resources")]
struct Machine {
    /// Worker threads
    #[option(value = "N", default = 2, default_text = "all cores", range = OptionRange::new(1.0, 64.0), role = Run)]
    threads: u16,
}

/// `KEY=VALUE`, again and again.
struct Pairs;

impl OptionCodec<String> for Pairs {
    const KIND: OptionKind = OptionKind::Text;

    fn parse(text: &str) -> Result<String, String> {
        if text.contains('=') { Ok(text.to_owned()) } else { Err("expected KEY=VALUE".to_owned()) }
    }

    fn json(value: &String) -> Value {
        value.as_str().into()
    }
}

/// Shade a grid.
///
/// More of it.
#[derive(Clone, Debug, PartialEq, Options)]
#[options(rules = RULES)]
struct Shade {
    /// Degrees clockwise from north, see [`Light`]
    #[option(value = "DEG", default_text = "315")]
    azimuth: Option<f64>,
    /// How high it stands
    #[option(default = 45.0, range = OptionRange::new(1.0, 90.0), alias = "height")]
    altitude: f64,
    /// The light
    light: Light,
    /// Drop what is redundant
    #[option(default = true, off = "Keep what is redundant")]
    drop: bool,
    /// Options of the format
    #[option(with = Pairs, short = 'c')]
    co: Vec<String>,
    #[option(flatten)]
    machine: Machine,
}

const RULES: &[OptionRule] = &[
    OptionRule::NotWith("azimuth", &["light=all-sides"]),
    OptionRule::NotWith("altitude", &["light=all-sides"]),
    OptionRule::Needs("drop=false", &["azimuth", "co"]),
];

fn filled(given: &Value) -> terrane_base::Result<Shade> {
    let options: Shade = fill(given.as_object().unwrap())?;
    check(&options)?;
    Ok(options)
}

#[test]
fn values_come_in_and_go_out_as_they_are() {
    let defaults = filled(&json!({})).unwrap();
    assert_eq!(defaults, Shade::default());
    assert!(defaults.drop && defaults.altitude == 45.0 && defaults.machine.threads == 2);
    assert!(changed(&defaults).is_empty());
    let given = json!({
        "azimuth": 90, "height": 60, "drop": false, "co": [["A", 1], "B=x"], "threads": 3
    });
    let options = filled(&given).unwrap();
    assert_eq!(options.co, ["A=1", "B=x"]);
    assert_eq!((options.azimuth, options.altitude, options.machine.threads), (Some(90.0), 60.0, 3));
    let told = Value::from(changed(&options));
    let expected = json!({ "azimuth": 90.0, "altitude": 60.0, "drop": false, "co": ["A=1", "B=x"], "threads": 3 });
    assert_eq!(told, expected);
    assert_eq!(filled(&Value::from(to_map(&options))).unwrap(), options);
    let sides = filled(&json!({ "light": "ALL_sides", "azimuth": null })).unwrap();
    assert_eq!(sides.light, Light::AllSides);
}

#[test]
fn what_is_the_same_is_noted_alike() {
    for same in
        [json!({}), json!({ "azimuth": 315 }), json!({ "azimuth": 3.15e2, "light": "one_side" })]
    {
        let options = filled(&same).unwrap();
        assert_eq!(noted(&options), to_map(&Shade::default()), "{same}");
        assert_eq!(settled(&options).unwrap(), Shade::default(), "{same}");
    }
    let other = filled(&json!({ "azimuth": 314, "threads": 3 })).unwrap();
    assert_eq!((noted(&other), settled(&other).unwrap()), (to_map(&other), other.clone()));
}

#[test]
fn what_is_wrong_names_options_and_what_was_expected() {
    for (given, words) in [
        (json!({ "azimut": 1 }), "unknown option \"azimut\"; did you mean ‹azimuth›?"),
        (json!({ "colour": 1 }), "unknown option \"colour\"; leave it out"),
        (json!({ "altitude": 50, "height": 60 }), "‹altitude› is given twice; leave"),
        (json!({ "altitude": "50" }), "‹altitude› is \"50\": expected a number"),
        (json!({ "altitude": true }), "‹altitude› is true: expected a number"),
        (json!({ "altitude": [1, 2] }), "‹altitude› is [1,2]: expected a number"),
        (json!({ "altitude": 91 }), "‹altitude› is 91: expected a number from 1 to 90"),
        (json!({ "altitude": "nan" }), "‹altitude› is NaN: expected a number from 1 to 90"),
        (json!({ "threads": 1.5 }), "‹threads› is \"1.5\": expected a whole number"),
        (json!({ "threads": 70_000 }), "expected a whole number from 1 to 64"),
        (json!({ "threads": 0 }), "‹threads› is 0: expected a whole number from 1 to 64"),
        (json!({ "threads": 3.0, "co": { "A=B": 1 } }), "‹co› is {\"A=B\":1}: expected text"),
        (json!({ "drop": "no" }), "‹drop› is \"no\": expected true or false"),
        (json!({ "drop": 1 }), "‹drop› is 1: expected true or false"),
        (json!({ "light": "none" }), "‹light› is \"none\": expected one-side or all-sides"),
        (json!({ "co": ["A=1", "B"] }), "‹co› is \"A=1 B\": expected KEY=VALUE"),
        (
            json!({ "azimuth": 1, "light": "all-sides" }),
            "‹azimuth› cannot be used with ‹light=all-sides›; leave one",
        ),
        (
            json!({ "drop": false }),
            "‹drop=false› requires ‹azimuth› or ‹co›; add ‹azimuth› or ‹co›, or",
        ),
    ] {
        let told = filled(&given).unwrap_err().to_string();
        assert!(told.contains(words), "{given}: {told}");
    }
}

#[test]
fn an_option_given_with_its_default_counts() {
    let lit = Shade { light: Light::AllSides, ..Shade::default() };
    check(&lit).unwrap();
    let told = check_given(&lit, &["altitude"]).unwrap_err().to_string();
    assert!(told.contains("‹altitude› cannot be used with ‹light=all-sides›"), "{told}");
}

#[test]
fn tables_say_all_that_is_said_of_fields() {
    let table = Shade::TABLE;
    assert_eq!(table.about, "Shade a grid.\n\nMore of it.");
    let names: Vec<_> = table.fields().iter().map(|field| field.name).collect();
    assert_eq!(names, ["azimuth", "altitude", "light", "drop", "co", "threads"]);
    let field = |name: &str| table.find(name).unwrap();
    assert_eq!(field("azimuth").about, "Degrees clockwise from north, see `Light`");
    assert_eq!(
        (field("azimuth").shape, field("azimuth").default_text),
        (OptionArity::Optional, Some("315"))
    );
    assert_eq!((field("height").name, field("threads").heading), ("altitude", "Resources"));
    assert_eq!((field("co").short, field("drop").off), (Some('c'), Some("Keep what is redundant")));
    assert!(
        (field("altitude").read)("x").is_err()
            && (field("altitude").read)("-1e3") == Ok(json!(-1e3))
    );
    let OptionKind::Choice(names) = field("light").kind else { panic!("no choice") };
    assert_eq!(names()[1].about, "From all sides");
    assert_eq!(<PlainCodec as OptionCodec<f64>>::json(&f64::NAN), json!("NaN"));
}
