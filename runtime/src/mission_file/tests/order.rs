//! Order of items: indices and jumps.

use super::*;

pub(super) const IN_LINE_ORDER: &str =
    "index: the indices are not 0, 1, 2, …; the items are flown in the order of their lines";

#[test]
fn items_are_flown_in_line_order_whatever_their_indices() {
    for (second, third) in [("4", "9"), ("1", "1"), ("0", "0"), ("3", "2")] {
        let text = SHORT
            .replace("\n2 0", &format!("\n{second} 0"))
            .replace("\n3 0", &format!("\n{third} 0"));
        let numbered = mission(&text);
        assert_eq!(numbered.waypoints(), mission(SHORT).waypoints());
        assert_eq!(notes(&numbered), [IN_LINE_ORDER]);
    }
}

#[test]
fn jump_uses_ascending_indices() {
    let jump = "4 0 3 177 2 2 0 0 0 0 0 1\n";
    let gaps = SHORT.replace("\n3 0", "\n5 0").replace("\n2 0", "\n4 0");
    let jumps = mission(&format!("{gaps}8 0 3 177 4 2 0 0 0 0 0 1\n"));
    assert_eq!(jumps.waypoints(), short_with(jump).waypoints());
}

#[test]
fn endless_jump_forward_is_taken() {
    let skipped = short_with(
        "4 0 3 177 6 -1 0 0 0 0 0 1\n5 0 3 16 0 0 0 0 39.5 -0.3085 30 1\n6 0 3 20 0 0 0 0 0 0 0 1\n",
    );
    assert_eq!(heights(&skipped), [25.0, 25.0, 30.0, 30.0]);
    assert!(skipped.notes().is_empty());
}

#[test]
fn jumps_between_jumps_are_limited() {
    let to_itself =
        |number: usize, times: usize| format!("{number} 0 3 177 {number} {times} 0 0 0 0 0 1\n");
    assert_eq!(
        short_with(&to_itself(4, ITEMS_MAX - 1)).waypoints().len(),
        3
    );
    let jumps: String = (4..ITEMS_MAX)
        .map(|number| to_itself(number, ITEMS_MAX))
        .collect();
    let refused = parse(Path::new("given"), &format!("{SHORT}{jumps}"));
    let refused = refused.unwrap_err().to_string();
    assert!(refused.contains("with its jumps repeated"), "{refused}");
}

#[test]
fn jump_is_repeated_as_often_as_given() {
    let jump = |times: &str| format!("4 0 3 177 2 {times} 0 0 0 0 0 1\n5 0 3 20 0 0 0 0 0 0 0 1\n");
    let twice = short_with(&jump("2"));
    assert_eq!(
        heights(&twice),
        [25.0, 25.0, 30.0, 25.0, 30.0, 25.0, 30.0, 30.0]
    );
    assert_eq!(short_with(&jump("0")).waypoints().len(), 4);
    let endless = short_with(&jump("-1"));
    assert_eq!(endless.waypoints().len(), 4);
    let note = "the endless jump is ignored; the swarm continues with the next item";
    assert_eq!(notes(&endless), [format!("item 4: {note}")]);
    let plan = PLAN.replacen("\"command\":20,", "\"command\":177,", 1);
    let plan = plan.replacen("[0,0,0,0,0,0,0]", "[7,1,0,0,0,0,0]", 1);
    let plan = plan
        .replacen("{\"autoContinue\"", "{\"doJumpId\":7,\"autoContinue\"", 2)
        .replacen("\"doJumpId\":7,", "", 1);
    assert_eq!(mission(&plan).waypoints().len(), 5);
}
