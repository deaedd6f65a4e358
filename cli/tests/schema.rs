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

fn all(schema: &Value, value: &Value) -> Vec<String> {
    let mut found = Vec::new();
    contradictions(schema, schema, value, "$", &mut found);
    found
}

#[test]
fn a_fix_is_what_its_schema_says() {
    let schema = north(&["schema", "find"]);
    for scenario in ["calm-bench", "stalled-motor"] {
        let fix = north(&["find", "--host", "--dwell", "5", "--scenario", scenario, "--json", "-"]);
        assert_eq!(all(&schema, &fix), [""; 0], "{scenario}");
        // The schema is not one that allows everything.
        let [mut wrong, mut lacking] = [fix.clone(), fix];
        wrong["runs"][0]["dwells"] = Value::from("none");
        lacking["runs"][0].as_object_mut().unwrap().remove("file");
        assert!(!all(&schema, &wrong).is_empty() && !all(&schema, &lacking).is_empty());
    }
    assert!(north(&["schema", "solve"])["properties"]["runs"].is_object() && north(&["schema", "doctor"]).is_object());
}
