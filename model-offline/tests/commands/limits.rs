//! Processes whose memory is limited end with a message, and are not ended.

use std::process::Command;

/// The exit code and what was told of a command whose addresses are limited to so many megabytes.
fn limited(megabytes: u32, arguments: &str) -> (Option<i32>, String) {
    let command =
        format!("ulimit -v {}; exec {} {arguments} --quiet", 1000 * megabytes, env!("CARGO_BIN_EXE_model-offline"));
    let output = Command::new("sh").args(["-c", &command]).output().unwrap();
    (output.status.code(), String::from_utf8(output.stderr).unwrap())
}

#[test]
fn too_few_addresses_are_told_and_enough_do() {
    for arguments in ["place paper", "place paper --threads 1", "place breast", "solve block --paddle 1 --depth 0.001"]
    {
        for megabytes in [150, 165, 180, 200, 300, 600, 1_200, 2_400] {
            let (code, told) = limited(megabytes, arguments);
            let in_one_line = told.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ");
            match code {
                Some(0) => {}
                Some(1) => {
                    let is_told =
                        ["unknowns would take", "to mesh the body would take"].iter().any(|t| in_one_line.contains(t));
                    assert!(is_told, "{arguments}, {megabytes} MB: {told}");
                }
                code => panic!("{arguments}, {megabytes} MB: {code:?}, {told}"),
            }
        }
    }
    // As much as any machine sets aside for a thread, and more.
    let (code, told) = limited(20_000, "place paper --threads 1");
    assert_eq!(code, Some(0), "{told}");
}
