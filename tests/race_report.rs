//! The race report as text.
#![allow(clippy::unwrap_used, reason = "a test that fails to set up has failed")]

mod races;

use reachcast::report::race_html;

#[test]
fn page_for_looking_at() {
    let page = race_html(&races::full());
    println!("{} bytes", page.len());
    std::fs::write("/tmp/racepage.html", page).unwrap();
}
