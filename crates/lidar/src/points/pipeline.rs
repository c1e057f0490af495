//! Stages from a file of JSON: a list of stages, or a pipeline of PDAL. Filters that both programs have are read, with
//! the defaults of PDAL; everything else is refused by name.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use serde_json::{Map, Value};

use super::stages::{AnyStage, StageText, stage_names};
use terrane_base::error::{Error, Result};
use terrane_base::limits;

/// Largest file.
const MAX_BYTES: u64 = 1 << 20;

/// A filter of PDAL.
struct PipelineFilter {
    name: &'static str,
    /// The options that are read, with their defaults.
    options: &'static [(&'static str, &'static str)],
    /// The stages of the values of these options, in this order.
    stages: fn(&[String]) -> std::result::Result<Vec<String>, String>,
}

/// The points that the ground filters leave out, as terrane always does.
const IGNORE: (&str, &str) = ("ignore", "Classification[7:7]");

/// Fails for other points to be left out than noise.
fn refuse_ignored(limits: &str) -> std::result::Result<(), String> {
    let is_noise = |limit: &str| {
        let limit = limit.trim();
        limit.is_empty() || limit == IGNORE.1 || limit == "Classification[18:18]"
    };
    match limits.split(',').all(is_noise) {
        true => Ok(()),
        false => Err(format!("\"ignore\" of {limits:?} is not supported; noise is always ignored")),
    }
}

/// Parameters of a method: names and numbers.
fn parameters(names: &[&str], values: &[String]) -> std::result::Result<String, String> {
    let all = names.iter().zip(values).map(|(name, value)| match value.parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(format!("{name}={number}")),
        _ => Err(format!("{value:?} is not a number")),
    });
    Ok(all.collect::<std::result::Result<Vec<_>, String>>()?.join(","))
}

/// The filters that are read.
const FILTERS: &[PipelineFilter] = &[
    PipelineFilter {
        name: "filters.assign",
        options: &[("value", "")],
        stages: |values| values[0].split('\n').map(assign).collect(),
    },
    PipelineFilter {
        name: "filters.colorization",
        options: &[("raster", ""), ("dimensions", "Red:1:1.0, Green:2:1.0, Blue:3:1.0")],
        stages: |values| values[1].split(',').map(|band| colour_band(&values[0], band)).collect(),
    },
    PipelineFilter {
        name: "filters.csf",
        options: &[("resolution", "1"), ("rigidness", "3"), ("threshold", "0.5"), IGNORE],
        stages: |values| {
            let names = ["cloth", "rigidness", "threshold"];
            refuse_ignored(&values[3])?;
            Ok(vec![format!("ground:csf:{}", parameters(&names, values)?)])
        },
    },
    PipelineFilter {
        name: "filters.expression",
        options: &[("expression", "")],
        stages: |values| Ok(vec![format!("where:{}", values[0])]),
    },
    PipelineFilter {
        name: "filters.hag_delaunay",
        options: &[],
        stages: |_| Ok(vec!["height-above-ground".to_owned()]),
    },
    // Several inputs are one cloud.
    PipelineFilter { name: "filters.merge", options: &[], stages: |_| Ok(Vec::new()) },
    PipelineFilter {
        name: "filters.mortonorder",
        options: &[],
        stages: |_| Ok(vec!["sort:morton".to_owned()]),
    },
    PipelineFilter {
        name: "filters.normal",
        options: &[("knn", "8")],
        stages: |values| {
            // PDAL counts the point itself.
            let others = values[0].parse::<u32>().ok().and_then(|knn| knn.checked_sub(1));
            let others =
                others.ok_or_else(|| format!("\"knn\" {:?} is not a number", values[0]))?;
            Ok(vec![format!("normals:k={others}")])
        },
    },
    PipelineFilter {
        name: "filters.outlier",
        options: &[("method", "statistical"), ("mean_k", "8"), ("multiplier", "2"), ("class", "7")],
        stages: |values| match values {
            [method, numbers @ ..] if method.eq_ignore_ascii_case("statistical") => {
                let names = ["k", "m", "class"];
                Ok(vec![format!("noise:statistical:{}", parameters(&names, numbers)?)])
            }
            _ => Err(format!("method {:?} is not supported; write statistical", values[0])),
        },
    },
    PipelineFilter {
        name: "filters.overlay",
        options: &[("datasource", ""), ("dimension", ""), ("column", "CLS")],
        stages: |values| Ok(vec![format!("overlay:{}:{}=\"{}\"", values[0], values[1], values[2])]),
    },
    PipelineFilter {
        name: "filters.range",
        options: &[("limits", "")],
        stages: |values| Ok(vec![format!("where:{}", range_condition(&values[0])?)]),
    },
    PipelineFilter {
        name: "filters.reprojection",
        options: &[("out_srs", "")],
        stages: |values| Ok(vec![format!("reproject:{}", values[0])]),
    },
    PipelineFilter {
        name: "filters.sample",
        options: &[("radius", "")],
        stages: |values| Ok(vec![format!("poisson:{}", values[0])]),
    },
    PipelineFilter {
        name: "filters.smrf",
        options: &[
            ("cell", "1"),
            ("scalar", "1.25"),
            ("slope", "0.15"),
            ("threshold", "0.5"),
            ("window", "18"),
            IGNORE,
        ],
        stages: |values| {
            let names = ["cell", "scalar", "slope", "threshold", "window"];
            refuse_ignored(&values[5])?;
            Ok(vec![format!("ground:smrf:{}", parameters(&names, values)?)])
        },
    },
    PipelineFilter {
        name: "filters.sort",
        options: &[("dimension", ""), ("order", "ASC")],
        stages: |values| match [values[0].as_str(), values[1].as_str()] {
            ["GpsTime", "ASC"] => Ok(vec!["sort:time".to_owned()]),
            _ => Err("only dimension GpsTime in order ASC is supported".to_owned()),
        },
    },
];

/// The stages of a file, in order.
///
/// # Errors
/// A file that cannot be read or is no list of stages; filters and options without a counterpart, each by its name and
/// place in the list.
pub(super) fn read(path: &Path) -> Result<Vec<AnyStage>> {
    let fail = |e| Error::read(path, e);
    let mut text = String::new();
    let file = File::open(path).map_err(fail)?;
    let bytes = file.take(MAX_BYTES + 1).read_to_string(&mut text).map_err(fail)?;
    limits::check("the size of the pipeline in bytes", bytes as u64, MAX_BYTES)
        .map_err(|e| e.in_file(path))?;
    let json: Value =
        serde_json::from_str(&text).map_err(|e| Error::bad_input(e.to_string()).in_file(path))?;
    let list = match &json {
        Value::Object(whole) if whole.len() == 1 => whole.get("pipeline").and_then(Value::as_array),
        whole => whole.as_array(),
    };
    let list = list.ok_or_else(|| {
        Error::bad_input("expected a list of stages")
            .in_file(path)
            .remedy("write [\"NAME:ARGUMENTS\", ...] or a pipeline of PDAL")
    })?;
    let mut stages = Vec::new();
    for (number, step) in list.iter().enumerate() {
        let found = stages_of(step).map_err(|what| {
            Error::bad_input(what)
                .at(format_args!("stage {}", number + 1))
                .in_file(path)
                .remedy("write NAME:ARGUMENTS as in ‹stage›, or a supported PDAL filter")
        })?;
        stages.extend(found);
    }
    Ok(stages)
}

fn stages_of(step: &Value) -> std::result::Result<Vec<AnyStage>, String> {
    let texts = match step {
        Value::String(text) if is_file(text) => {
            return Err(format!("{text:?} is a file; files are given on the command line"));
        }
        Value::String(text) => vec![text.clone()],
        Value::Object(filter) => texts_of(filter)?,
        _ => return Err("expected a text or an object".to_owned()),
    };
    texts.iter().map(|text| Ok(text.parse::<StageText>()?.stage().clone())).collect()
}

/// Whether a text names a file: PDAL takes texts for files.
fn is_file(text: &str) -> bool {
    let name = text.split(':').next().unwrap_or_default();
    let is_known = stage_names().any(|known| known.name == name.trim());
    let is_drive = text[name.len()..].starts_with(":\\");
    !is_known && (is_drive || name.contains(['.', '/', '\\', '*']))
}

/// The stages of a filter of PDAL, as text.
fn texts_of(filter: &Map<String, Value>) -> std::result::Result<Vec<String>, String> {
    let name = filter.get("type").and_then(Value::as_str).ok_or("it has no \"type\"")?;
    if name.starts_with("readers.") || name.starts_with("writers.") {
        return Err(format!("{name} is not supported: files are given on the command line"));
    }
    let known = FILTERS.iter().find(|known| known.name == name).ok_or_else(|| {
        let names: Vec<_> = FILTERS.iter().map(|known| known.name).collect();
        format!("{name} is not supported; supported are {}", names.join(", "))
    })?;
    let is_known = |key: &str| {
        key == "type" || key == "tag" || known.options.iter().any(|(option, _)| *option == key)
    };
    if let Some(key) = filter.keys().find(|key| !is_known(key)) {
        return Err(format!("{name} with {key:?} is not supported"));
    }
    let values = known.options.iter().map(|(key, default)| match filter.get(*key) {
        None if default.is_empty() => Err(format!("{name} lacks {key:?}")),
        None => Ok((*default).to_owned()),
        Some(value) => {
            text_of(value).ok_or_else(|| format!("{name}: {key:?} is not a string or number"))
        }
    });
    (known.stages)(&values.collect::<std::result::Result<Vec<_>, String>>()?)
        .map_err(|what| format!("{name}: {what}"))
}

/// A text, a number, or texts by lines.
fn text_of(value: &Value) -> Option<String> {
    match value {
        Value::String(text) => Some(text.clone()),
        Value::Number(number) => Some(number.to_string()),
        Value::Array(texts) => {
            let texts: Option<Vec<_>> = texts.iter().map(Value::as_str).collect();
            texts.map(|texts| texts.join("\n"))
        }
        _ => None,
    }
}

/// "Red:1:1.0" as a stage.
fn colour_band(raster: &str, band: &str) -> std::result::Result<String, String> {
    let parts: Vec<_> = band.split(':').map(str::trim).collect();
    match parts[..] {
        [name, number] | [name, number, "1" | "1.0"] if number.parse::<u32>().is_ok() => {
            Ok(format!("sample-grid:{raster}:{name}:nearest:band={number}"))
        }
        _ => {
            Err(format!("{band:?} is not a dimension, a band and a scale of 1, such as Red:1:1.0"))
        }
    }
}

/// "Classification = 2" as a stage.
fn assign(value: &str) -> std::result::Result<String, String> {
    match value.to_ascii_lowercase().contains(" where ") {
        true => Err("WHERE is not supported".to_owned()),
        false => Ok(format!("assign:{value}")),
    }
}

/// The condition of limits such as "Classification[2:2],Z(0:10]": those of one dimension are alternatives.
fn range_condition(limits: &str) -> std::result::Result<String, String> {
    let mut by_name: Vec<(&str, Vec<String>)> = Vec::new();
    for limit in limits.split(',').map(str::trim) {
        let (name, condition) = limit_condition(limit)
            .ok_or_else(|| format!("{limit:?} is not a limit such as Classification[2:2]"))?;
        match by_name.iter_mut().find(|(known, _)| *known == name) {
            Some((_, all)) => all.push(condition),
            None => by_name.push((name, vec![condition])),
        }
    }
    let all: Vec<_> = by_name.iter().map(|(_, any)| format!("({})", any.join(" or "))).collect();
    Ok(all.join(" and "))
}

/// A dimension, and the condition of one limit.
fn limit_condition(limit: &str) -> Option<(&str, String)> {
    let at = limit.find(['[', '('])?;
    let (name, range) = limit.split_at(at);
    let (name, is_not) = name.strip_suffix('!').map_or((name, false), |name| (name, true));
    let low_sign = if range.starts_with('[') { ">=" } else { ">" };
    let high_sign = match range.chars().last()? {
        ']' => "<=",
        ')' => "<",
        _ => return None,
    };
    let (low, high) = range.get(1..range.len() - 1)?.split_once(':')?;
    let mut sides = Vec::new();
    for (sign, bound) in [(low_sign, low), (high_sign, high)] {
        if !bound.trim().is_empty() {
            let bound = bound.trim().parse().ok().filter(|bound: &f64| bound.is_finite())?;
            sides.push(format!("\"{name}\" {sign} {bound}"));
        }
    }
    let both = sides.join(" and ");
    let is_valid = !sides.is_empty() && !name.is_empty() && !name.contains('"');
    is_valid.then(|| (name, if is_not { format!("not ({both})") } else { format!("({both})") }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stages(json: &str) -> Result<Vec<AnyStage>> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("pipeline.json");
        std::fs::write(&path, json).unwrap();
        read(&path)
    }

    #[test]
    fn filters_become_the_stages_of_the_same_work() {
        let json = r#"{"pipeline": [
            {"type": "filters.outlier", "mean_k": 12},
            {"type": "filters.csf", "resolution": 0.5, "tag": "ground"},
            {"type": "filters.smrf", "slope": 0.2, "ignore": "Classification[7:7]"},
            {"type": "filters.hag_delaunay"},
            {"type": "filters.assign", "value": ["Classification = 3", "Intensity = Intensity / 2"]},
            {"type": "filters.range", "limits": "Classification[2:2],Z(0:],Classification[3:5)"},
            {"type": "filters.range", "limits": "Intensity![7:9]"},
            {"type": "filters.expression", "expression": "Z > 1 && !(ReturnNumber == 2)"},
            {"type": "filters.merge"},
            {"type": "filters.sample", "radius": 0.25},
            {"type": "filters.normal", "knn": 9},
            {"type": "filters.overlay", "datasource": "lakes.shp", "dimension": "Classification"},
            {"type": "filters.colorization", "raster": "photo.tif"},
            {"type": "filters.reprojection", "out_srs": "EPSG:4326"},
            {"type": "filters.sort", "dimension": "GpsTime"},
            {"type": "filters.mortonorder"},
            "thin:2:lowest"
        ]}"#;
        let expected = [
            "noise:statistical:k=12,m=2,class=7",
            "ground:csf:cloth=0.5,rigidness=3,threshold=0.5",
            "ground:smrf:cell=1,scalar=1.25,slope=0.2,threshold=0.5,window=18",
            "height-above-ground",
            "assign:Classification = 3",
            "assign:Intensity = Intensity / 2",
            "where:((\"Classification\" >= 2 and \"Classification\" <= 2) or (\"Classification\" >= 3 and \"Classification\" < 5)) and ((\"Z\" > 0))",
            "where:(not (\"Intensity\" >= 7 and \"Intensity\" <= 9))",
            "where:Z > 1 && !(ReturnNumber == 2)",
            "poisson:0.25",
            "normals:k=8",
            "overlay:lakes.shp:Classification=\"CLS\"",
            "sample-grid:photo.tif:Red:nearest",
            "sample-grid:photo.tif:Green:nearest:band=2",
            "sample-grid:photo.tif:Blue:nearest:band=3",
            "reproject:EPSG:4326",
            "sort:time",
            "sort:morton",
            "thin:2:lowest",
        ];
        let expected = expected.map(|text| text.parse::<StageText>().unwrap().stage().clone());
        assert_eq!(stages(json).unwrap(), expected);
        assert_eq!(stages("[]").unwrap(), []);
    }

    #[test]
    fn what_has_no_counterpart_is_refused_by_name_and_place() {
        for (json, told) in [
            ("{", "EOF"),
            ("3", "expected a list of stages"),
            ("{\"stages\": []}", "expected a list of stages"),
            ("[\"dedupe\", \"in.laz\"]", "stage 2"),
            ("[\"in.laz\"]", "\"in.laz\" is a file"),
            ("[\"better\"]", "expected one of dedupe"),
            ("[\"thinn:0.5\"]", "not thinn"),
            ("[4]", "expected a text or an object"),
            ("[{}]", "no \"type\""),
            ("[{\"type\": \"readers.las\", \"filename\": \"a\"}]", "readers.las is not supported"),
            ("[{\"type\": \"filters.cluster\"}]", "filters.cluster is not supported"),
            ("[{\"type\": \"filters.csf\", \"iterations\": 3}]", "filters.csf with \"iterations\""),
            ("[{\"type\": \"filters.csf\", \"rigidness\": 9}]", "rigidness"),
            ("[{\"type\": \"filters.csf\", \"rigidness\": true}]", "not a string or number"),
            ("[{\"type\": \"filters.outlier\", \"method\": \"radius\"}]", "\"radius\" is not"),
            ("[{\"type\": \"filters.assign\", \"value\": \"Z = 3 WHERE X > 1\"}]", "WHERE"),
            ("[{\"type\": \"filters.assign\"}]", "lacks \"value\""),
            ("[{\"type\": \"filters.range\", \"limits\": \"Z\"}]", "not a limit"),
            ("[{\"type\": \"filters.range\", \"limits\": \"Z[:]\"}]", "not a limit"),
            ("[{\"type\": \"filters.range\", \"limits\": \"Z[1:x]\"}]", "not a limit"),
            ("[{\"type\": \"filters.range\", \"limits\": \"Z[1:2\"}]", "not a limit"),
            ("[{\"type\": \"filters.sort\", \"dimension\": \"Z\"}]", "GpsTime"),
            ("[{\"type\": \"filters.sample\"}]", "lacks \"radius\""),
            ("[{\"type\": \"filters.normal\", \"knn\": 2.5}]", "not a number"),
            (
                "[{\"type\": \"filters.colorization\", \"raster\": \"a\", \"dimensions\": \"Red:1:256\"}]",
                "a scale of 1",
            ),
            ("[{\"type\": \"filters.csf\", \"threshold\": \"0.5:reclassify=9\"}]", "not a number"),
            ("[{\"type\": \"filters.csf\", \"ignore\": \"Classification[6:6]\"}]", "\"ignore\""),
            ("[{\"type\": \"filters.range\", \"limits\": \"Z[0:inf]\"}]", "not a limit"),
            ("[\"C:\\\\data\\\\in.las\"]", "is a file"),
            ("{\"pipeline\": [], \"stages\": []}", "expected a list of stages"),
        ] {
            let error = stages(json).unwrap_err().to_string();
            assert!(error.contains(told) && error.contains("pipeline.json"), "{json}: {error}");
        }
        assert!(read(Path::new("/nowhere/pipeline.json")).is_err());
    }
}
