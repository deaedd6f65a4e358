//! What commands write is what their schemas say.

use std::process::{Command, Stdio};

use serde_json::Value;

fn north(arguments: &[&str]) -> Value {
    let output = Command::new(env!("CARGO_BIN_EXE_north")).args(arguments).stdin(Stdio::null()).output().unwrap();
    serde_json::from_slice(&output.stdout).unwrap_or_else(|_| panic!("{}", String::from_utf8_lossy(&output.stderr)))
}

/// What of a value contradicts a schema: of the keywords those that the schemas here use.
fn contradictions(root: &Value, schema: &Value, value: &Value, at: &str, found: &mut Vec<String>) {
    if let Some(name) = schema["$ref"].as_str() {
        return contradictions(root, &root["$defs"][name.trim_start_matches("#/$defs/")], value, at, found);
    }
    let is = |name: &str| match name {
        "object" => value.is_object(),
        "array" => value.is_array(),
        "string" => value.is_string(),
        "number" => value.is_number(),
        "integer" => value.is_u64() || value.is_i64(),
        "boolean" => value.is_boolean(),
        _ => value.is_null(),
    };
    let types: Vec<&str> = match &schema["type"] {
        Value::String(name) => vec![name],
        Value::Array(names) => names.iter().filter_map(Value::as_str).collect(),
        _ => Vec::new(),
    };
    if !types.is_empty() && !types.iter().any(|name| is(name)) {
        found.push(format!("{at} is no {}: {value}", types.join(" or ")));
    }
    if let (Some(choices), Some(_)) = (schema["anyOf"].as_array(), schema["properties"].as_object()) {
        let fits = choices.iter().any(|choice| {
            let mut inner = Vec::new();
            contradictions(root, &together(schema, choice), value, at, &mut inner);
            inner.is_empty()
        });
        if !fits {
            found.push(format!("{at} is none of the choices with what all have: {value}"));
        }
        return;
    }
    if let Some(choices) = schema["anyOf"].as_array() {
        let fits = choices.iter().any(|choice| {
            let mut inner = Vec::new();
            contradictions(root, choice, value, at, &mut inner);
            inner.is_empty()
        });
        if !fits {
            found.push(format!("{at} is none of the choices: {value}"));
        }
    }
    for name in schema["required"].as_array().into_iter().flatten().filter_map(Value::as_str) {
        if value.get(name).is_none() {
            found.push(format!("{at} lacks {name}"));
        }
    }
    for (name, inner) in value.as_object().into_iter().flatten() {
        match schema["properties"].get(name) {
            Some(of_property) => contradictions(root, of_property, inner, &format!("{at}.{name}"), found),
            // An object whose fields are not all known says so.
            None if schema["properties"].is_object() && schema["additionalProperties"].is_null() => {
                found.push(format!("{at}.{name} is not in the schema"));
            }
            None => {}
        }
    }
    for inner in value.as_array().into_iter().flatten().filter(|_| !schema["items"].is_null()) {
        contradictions(root, &schema["items"], inner, &format!("{at}[]"), found);
    }
}

/// An object with the fields of a schema and those of one of its choices.
fn together(schema: &Value, choice: &Value) -> Value {
    let mut both = choice.clone();
    for (name, property) in schema["properties"].as_object().into_iter().flatten() {
        both["properties"][name] = property.clone();
    }
    let required = [schema, choice].into_iter().flat_map(|of| of["required"].as_array().into_iter().flatten().cloned());
    both["required"] = required.collect();
    both
}

fn all(schema: &Value, value: &Value) -> Vec<String> {
    let mut found = Vec::new();
    contradictions(schema, schema, value, "$", &mut found);
    found
}

#[test]
fn a_fix_is_what_its_schema_says() {
    let schema = north(&["schema", "find"]);
    for scenario in ["calm-bench", "stalled-motor"] {
        let fix = north(&["find", "--host", "--order", "plain", "--dwell", "5", "--scenario", scenario, "--json", "-"]);
        assert_eq!(all(&schema, &fix), [""; 0], "{scenario}");
        // The schema is not one that allows everything.
        let [mut wrong, mut lacking] = [fix.clone(), fix];
        wrong["runs"][0]["dwells"] = Value::from("none");
        lacking["runs"][0].as_object_mut().unwrap().remove("file");
        assert!(!all(&schema, &wrong).is_empty() && !all(&schema, &lacking).is_empty());
    }
    assert!(north(&["schema", "solve"])["properties"]["runs"].is_object() && north(&["schema", "doctor"]).is_object());
}

#[test]
fn a_diagnosis_is_what_its_schema_says() {
    let folder = tempfile::tempdir().unwrap();
    let campaign = folder.path().join("campaign").display().to_string();
    let simulate =
        ["simulate", "--scenario", "warm-up", "--runs", "4", "--order", "plain", "--dwell", "8", "--out", &campaign];
    assert!(
        Command::new(env!("CARGO_BIN_EXE_north"))
            .args(simulate)
            .stdin(Stdio::null())
            .output()
            .unwrap()
            .status
            .success()
    );
    let schema = north(&["schema", "diagnose"]);
    let diagnosis = north(&["diagnose", &campaign, "--json", "-"]);
    assert_eq!(all(&schema, &diagnosis), [""; 0]);
    let mut wrong = diagnosis;
    wrong["unexplained"] = Value::from("perhaps");
    assert!(!all(&schema, &wrong).is_empty());
}

/// A block that stands at 50° of latitude, forward to the north: 9.668 °/h forward, 11.522 °/h up; a hundredth of it as a ripple.
#[test]
fn headings_and_tracks_are_what_their_schemas_say() {
    let folder = tempfile::tempdir().unwrap();
    let [block, track] = ["block.csv", "track.csv"].map(|name| folder.path().join(name).display().to_string());
    let mut text = String::from("t_s,gx_arcsec,gy_arcsec,gz_arcsec,ax_m_s2,ay_m_s2,az_m_s2\n");
    for row in 1..=1200 {
        let ripple = 0.001 * f64::from(row * 7919 % 101 - 50);
        text += &format!("{:.1},{},{ripple},{},0.0,0.0,9.81\n", 0.1 * f64::from(row), 0.9668 + ripple, 1.1522 - ripple);
    }
    std::fs::write(&block, text).unwrap();
    let at = ["--latitude", "50", "--json", "-"];
    let aligned = north(&[&["align", &block, "--window", "40"], &at[..]].concat());
    assert_eq!(all(&north(&["schema", "align"]), &aligned), [""; 0]);
    let tracked = north(&[&["track", &block, "--heading", "0", "--out", &track], &at[..]].concat());
    assert_eq!(all(&north(&["schema", "track"]), &tracked), [""; 0]);
}
