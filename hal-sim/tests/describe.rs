//! What a scenario file may hold is what is described.

use hal_sim::Scenario;

/// Every default that is described, put into a file where it is said to stand, is read, and changes nothing.
#[test]
fn what_is_described_is_a_scenario_file() {
    let text: String = Scenario::describe()
        .iter()
        .filter(|group| !group.table.list && !["block", "carry"].contains(&group.table.name.as_str()))
        .flat_map(|group| {
            let heading = (!group.table.name.is_empty()).then(|| format!("{}\n", group.table));
            let values = group.fields.iter().filter(|field| !field.default.is_empty());
            heading.into_iter().chain(values.map(|field| format!("{} = {}\n", field.name, field.default)))
        })
        .collect();
    assert_eq!(Scenario::parse(&text, "described.toml").unwrap(), Scenario::default(), "{text}");
    assert!(text.contains("[base.wind]") && text.contains("latitude_deg = 34.75"), "{text}");
}

#[test]
fn choices_and_lists_are_described() {
    let groups = Scenario::describe();
    let shocks = groups.iter().find(|group| group.table.to_string() == "[[base.shocks]]").unwrap();
    assert!(shocks.fields.iter().any(|field| field.name == "at_s" && field.allowed == "0.0 to 1000000.0"));
    let faults = groups.iter().find(|group| group.table.to_string() == "[[encoder.faults]]").unwrap();
    assert_eq!(faults.fields[0].allowed, "stuck, bus-high, bus-low");
    assert!(groups.iter().flat_map(|group| &group.fields).all(|field| !field.meaning.is_empty()));
}
