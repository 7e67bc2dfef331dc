use super::*;

pub(crate) fn at(seconds: f64) -> Timestamp {
    Timestamp::from_secs_f64(seconds)
}

pub(crate) fn link(a: u32, b: u32, loss: f64) -> Link {
    Link::between(NodeId(a), NodeId(b), [loss; 2]).unwrap()
}

/// A line of nodes whose links lose no frames.
pub(crate) fn line(nodes: u32) -> Vec<Link> {
    (1..nodes).map(|id| link(id - 1, id, 0.0)).collect()
}

fn live(nodes: usize) -> Vec<Option<u32>> {
    vec![Some(0); nodes]
}

fn members(segments: &Segments) -> Vec<Vec<u32>> {
    let ids = |segment: &Segment| segment.members.iter().map(|id| id.0).collect();
    segments.iter().map(ids).collect()
}

fn set(ids: &[u32]) -> BTreeSet<NodeId> {
    ids.iter().copied().map(NodeId).collect()
}

#[test]
fn links_are_up_grey_or_down_by_their_loss() {
    let is_up = |loss| Link::between(NodeId(1), NodeId(0), [0.0, loss]).map(|link| link.is_up());
    assert_eq!(is_up(0.4), Some(true));
    assert_eq!(is_up(0.41), Some(false));
    assert_eq!(is_up(0.99), Some(false));
    assert_eq!(is_up(0.999), Some(false));
    let one_way = Link::between(NodeId(1), NodeId(0), [0.0, 0.999]).unwrap();
    assert_eq!(one_way.state, LinkState::OneWay(NodeId(0)));
    assert_eq!(Link::between(NodeId(1), NodeId(0), [0.999; 2]), None);
}

#[test]
fn new_one_way_link_connects_no_drones_and_is_a_change() {
    let mut segments = Segments::default();
    segments.look(at(1.0), live(3), vec![link(0, 1, 0.0)]);
    let heard = Link::between(NodeId(2), NodeId(1), [0.1, 1.0]).unwrap();
    assert!(segments.look(at(2.0), live(3), vec![link(0, 1, 0.0), heard]));
    assert_eq!(members(&segments), [vec![0, 1], vec![2]]);
    assert!(!segments.are_connected(NodeId(1), NodeId(2)));
    let mut since = segments.iter().map(|it| it.unchanged_since);
    assert!(since.all(|since| since == at(2.0)));
}

#[test]
fn frame_over_a_link_that_no_look_found_is_a_change() {
    let links = vec![link(0, 1, 0.0), link(2, 3, 0.0), link(3, 4, 0.6)];
    let mut segments = Segments::default();
    segments.look(at(1.0), live(5), links.clone());
    let unchanged_since =
        |segments: &Segments| -> Vec<_> { segments.iter().map(|it| it.unchanged_since).collect() };
    // Over links that are known, and from a node of no segment.
    for (from, by) in [(1, 0), (2, 3), (4, 3), (9, 1)] {
        segments.heard(at(2.0), NodeId(from), NodeId(by));
    }
    assert_eq!(unchanged_since(&segments), [at(1.0); 3]);
    segments.heard(at(3.0), NodeId(2), NodeId(1));
    assert_eq!(unchanged_since(&segments), [at(3.0), at(3.0), at(1.0)]);
    assert_eq!(members(&segments), [vec![0, 1], vec![2, 3], vec![4]]);
    assert!(!segments.look(at(4.0), live(5), links));
}

#[test]
fn segments_are_connected_by_links_that_are_up() {
    let mut segments = Segments::default();
    let links = vec![link(3, 1, 0.3), link(1, 0, 0.0), link(4, 2, 0.4)];
    segments.look(at(1.0), live(6), links);
    assert_eq!(members(&segments), [vec![0, 1, 3], vec![2, 4], vec![5]]);
    assert!(segments.iter().all(|segment| segment.is_decided));
    assert_eq!(segments.segment_of(NodeId(4)), set(&[2, 4]));
}

#[test]
fn a_grey_link_decides_only_where_no_other_connects() {
    let mut segments = Segments::default();
    let mut links = line(3);
    links.extend([link(0, 2, 0.6), link(2, 3, 0.6), link(4, 5, 0.0)]);
    segments.look(at(1.0), live(6), links);
    let decided: Vec<_> = segments.iter().map(|segment| segment.is_decided).collect();
    assert_eq!(members(&segments), [vec![0, 1, 2], vec![3], vec![4, 5]]);
    assert_eq!(decided, [false, false, true]);
    assert!((0..3).all(|id| segments.are_connected(NodeId(id), NodeId(3))));
}

#[test]
fn a_node_that_relays_nothing_connects_no_others() {
    let mut segments = Segments::default();
    let mut live = live(3);
    live[1] = None;
    segments.look(at(1.0), live, line(3));
    assert_eq!(members(&segments), [[0], [2]]);
    assert_eq!(segments.segment_of(NodeId(1)), set(&[1]));
    assert!(!segments.are_connected(NodeId(0), NodeId(2)));
}

#[test]
fn a_segment_is_unchanged_until_a_link_changes_or_a_member_fails() {
    let mut segments = Segments::default();
    let mut links = line(3);
    links.push(link(3, 4, 0.0));
    let unchanged_since =
        |segments: &Segments| -> Vec<_> { segments.iter().map(|it| it.unchanged_since).collect() };
    segments.look(at(1.0), live(5), links.clone());
    links.reverse();
    segments.look(at(2.0), live(5), links.clone());
    assert_eq!(unchanged_since(&segments), [at(1.0), at(1.0)], "no change");
    links.push(link(0, 2, 0.7));
    segments.look(at(3.0), live(5), links.clone());
    assert_eq!(unchanged_since(&segments), [at(3.0), at(1.0)], "a new link");
    links.pop();
    segments.look(at(4.0), live(5), links.clone());
    assert_eq!(
        unchanged_since(&segments),
        [at(4.0), at(1.0)],
        "a lost link"
    );
    let mut failed = live(5);
    failed[4] = Some(1);
    segments.look(at(5.0), failed, links);
    assert_eq!(
        unchanged_since(&segments),
        [at(4.0), at(5.0)],
        "an actor was restarted"
    );
}

#[test]
fn a_split_changes_both_segments() {
    let mut segments = Segments::default();
    segments.look(at(1.0), live(4), line(4));
    segments.look(at(2.0), live(4), vec![link(0, 1, 0.0), link(2, 3, 0.0)]);
    assert!(
        segments
            .iter()
            .all(|segment| segment.unchanged_since == at(2.0))
    );
}

#[test]
fn two_nodes_are_together_since_they_were_last_apart() {
    let mut segments = Segments::default();
    let (ends, second) = ((NodeId(0), NodeId(2)), Duration::from_secs(1));
    segments.look(at(1.0), live(3), line(3));
    assert!(segments.have_been_together(ends, at(1.5), 10 * second));
    segments.look(at(2.0), live(3), vec![link(0, 1, 0.0)]);
    assert!(!segments.have_been_together(ends, at(2.0), Duration::ZERO));
    segments.look(at(3.0), live(3), line(3));
    segments.look(at(4.0), live(3), vec![link(0, 2, 0.0)]);
    assert!(segments.have_been_together(ends, at(5.0), 2 * second));
    assert!(!segments.have_been_together(ends, at(5.0), 2 * second + second / 10));
    segments.forget_older(at(5.0), second / 2);
    assert!(
        segments.have_been_together(ends, at(5.0), 3 * second),
        "older history is dropped"
    );
}

#[test]
fn diameter_is_the_most_hops_between_two_members() {
    let mut segments = Segments::default();
    let mut links = line(6);
    links.push(link(0, 3, 0.0));
    links.push(link(0, 5, 0.8));
    segments.look(at(1.0), live(8), links);
    let hops: Vec<_> = segments
        .iter()
        .map(|segment| segments.diameter(segment))
        .collect();
    assert_eq!(hops, [4, 0, 0], "from 1 to 5, over 0 or over 2");
}
