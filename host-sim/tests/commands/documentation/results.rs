//! The README's table of results, held against what the command beside it has computed.

use serde_json::Value;

/// The table's rows below this heading, cells trimmed.
const HEADING: &str = "| tissue | table knows |";

fn rows(page: &str) -> Vec<Vec<&str>> {
    let lines = page.lines().skip_while(|line| !line.starts_with(HEADING)).skip(2);
    let table = lines.take_while(|line| line.starts_with('|'));
    table.map(|line| line.trim_matches('|').split('|').map(str::trim).collect()).collect()
}

/// Whether a number is the value, rounded to as many decimals as it is written with.
fn is_rounded(written: &str, value: f64) -> bool {
    let decimals = written.split_once('.').map_or(0, |(_, decimals)| decimals.len());
    format!("{value:.decimals$}") == written
}

/// Whether a cell tells of a strategy's largest error and of its paddle; empty where it was not simulated.
fn tells(cell: &str, strategy: &Value) -> bool {
    let Some(error) = strategy["max_orthogonal_error"].as_f64() else { return cell.is_empty() };
    let (number, paddle) = cell.split_once(" (paddle ").map_or((cell, None), |(n, p)| (n, p.strip_suffix(')')));
    is_rounded(number, error) && paddle.map(str::to_owned) == strategy["paddle"].as_u64().map(|p| p.to_string())
}

/// What the page's table says otherwise than the result of `host-sim run`.
pub(crate) fn differences(page: &str, result: &Value) -> Vec<String> {
    let (rows, cases) = (rows(page), result["cases"].as_array().unwrap());
    let mut wrong = Vec::new();
    if rows.len() != cases.len() {
        wrong.push(format!("{} rows for {} cases", rows.len(), cases.len()));
    }
    for (row, case) in rows.iter().zip(cases) {
        let strategies = &case["strategies"];
        // Without a paddle, what the table knows makes no difference: a case that did not run it tells that of its tissue.
        let of_tissue = |other: &&Value| other["tissue"] == case["tissue"] && !other["strategies"]["none"].is_null();
        let none = cases.iter().find(of_tissue).map_or(&Value::Null, |other| &other["strategies"]["none"]);
        let told = row.len() == 6
            && [row[0], row[1]] == [case["tissue"].as_str().unwrap(), case["table_tissue"].as_str().unwrap()]
            && tells(row[2], none)
            && tells(row[3], &strategies["static"])
            && tells(row[4], &strategies["dynamic"])
            && row[5].strip_suffix(" ×").is_some_and(|n| is_rounded(n, case["improvement"].as_f64().unwrap()));
        if !told {
            let of = |strategy: &str| {
                (strategies[strategy]["max_orthogonal_error"].clone(), strategies[strategy]["paddle"].clone())
            };
            let computed = ["none", "static", "dynamic"].map(of);
            wrong.push(format!("{row:?} where {computed:?}, {} were computed", case["improvement"]));
        }
    }
    wrong
}

#[test]
fn another_digit_paddle_or_row_is_found() {
    let row = "| inclusion | inclusion | 0.00158 | 0.00044 (paddle 2) | 0.000010 (paddle 3) | 43 × |";
    let page = |row: &str| format!("text\n{HEADING} …\n|---|\n{row}\n\n| more |");
    let result = serde_json::json!({ "cases": [{
        "tissue": "inclusion", "table_tissue": "inclusion", "improvement": 42.7,
        "strategies": {
            "none": { "max_orthogonal_error": 0.001584, "paddle": null },
            "static": { "max_orthogonal_error": 0.000436, "paddle": 2 },
            "dynamic": { "max_orthogonal_error": 0.0000102, "paddle": 3 },
        },
    }] });
    assert!(differences(&page(row), &result).is_empty());
    for (right, wrong) in
        [("0.00158", "0.00159"), ("paddle 2", "paddle 4"), ("0.000010", ""), ("43", "44"), ("| inc", "| homo")]
    {
        assert_eq!(differences(&page(&row.replacen(right, wrong, 1)), &result).len(), 1, "{wrong}");
    }
    assert_eq!(differences("no table", &result), ["0 rows for 1 cases"]);
}
