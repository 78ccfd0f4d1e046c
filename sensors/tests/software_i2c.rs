//! The I²C bus made by software, against a device that watches the two wires:
//! what it sees, when, and that every wait ends.

use dtof_sensors::i2c::Error;
use embedded_hal::i2c::{I2c, Operation};
use proptest::prelude::*;

use crate::common::wires::{ADDRESS, Bus, LOOK_NS, PERIOD_NS, Phase, SCL, SDA, Seen, bus};

/// A transaction: what is written, or how many bytes are read.
#[derive(Clone, Debug)]
enum Part {
    Write(Vec<u8>),
    Read(usize),
}

/// What the contract of `embedded_hal::i2c::I2c::transaction` makes a device see.
fn expected(parts: &[Part]) -> Vec<Seen> {
    let parts: Vec<&Part> = parts
        .iter()
        .filter(|part| !matches!(part, Part::Read(0)))
        .collect();
    let reads = |part: &Part| matches!(part, Part::Read(_));
    let mut seen = Vec::new();
    let mut next = 0;
    for (index, part) in parts.iter().enumerate() {
        if index == 0 || reads(parts[index - 1]) != reads(part) {
            seen.push(Seen::Start);
            seen.push(Seen::Address(ADDRESS, reads(part)));
        }
        match part {
            Part::Write(bytes) => seen.extend(bytes.iter().copied().map(Seen::Written)),
            Part::Read(count) => {
                let goes_on = parts.get(index + 1).is_some_and(|next| reads(next));
                for left in (0..*count).rev() {
                    seen.push(Seen::Read(next, left > 0 || goes_on));
                    // A device sends what it has got ready anew after a START.
                    next += 1;
                }
            }
        }
    }
    if !parts.is_empty() {
        seen.push(Seen::Stop);
    }
    seen
}

fn run(bus: &mut Bus, parts: &[Part]) -> Result<Vec<u8>, Error> {
    let buffers = parts.iter().map(|part| match part {
        Part::Write(bytes) => bytes.clone(),
        Part::Read(count) => vec![0xAA; *count],
    });
    let mut buffers: Vec<Vec<u8>> = buffers.collect();
    let operations = parts.iter().zip(&mut buffers);
    let operations = operations.map(|(part, buffer)| match part {
        Part::Write(_) => Operation::Write(buffer),
        Part::Read(_) => Operation::Read(buffer),
    });
    let mut operations: Vec<Operation<'_>> = operations.collect();
    bus.transaction(ADDRESS, &mut operations)?;
    let read = parts.iter().zip(buffers);
    let read = read.filter(|(part, _)| matches!(part, Part::Read(_)));
    Ok(read.flat_map(|(_, buffer)| buffer).collect())
}

fn part() -> impl Strategy<Value = Part> {
    prop_oneof![
        proptest::collection::vec(any::<u8>(), 0..5).prop_map(Part::Write),
        (0usize..5).prop_map(Part::Read),
    ]
}

proptest! {
    #[test]
    fn any_transaction_is_what_its_contract_says(
        parts in proptest::collection::vec(part(), 0..6),
        stretch_ns in prop_oneof![Just(0), 0u64..50_000],
        rise_ns in proptest::sample::select(vec![0, 50, 300]),
    ) {
        let (mut bus, wires) = bus();
        wires.borrow_mut().stretch_ns = stretch_ns;
        wires.borrow_mut().rise_ns = rise_ns;
        let read = run(&mut bus, &parts).unwrap();
        let wires = wires.borrow();
        prop_assert_eq!(&wires.seen, &expected(&parts));
        let count = u8::try_from(read.len()).unwrap();
        prop_assert_eq!(read, (0..count).collect::<Vec<_>>());
        // Fast mode, and both wires free afterwards.
        prop_assert!(wires.shortest_low >= 1300);
        prop_assert!(wires.shortest_high >= 600);
        prop_assert!(wires.shortest_period >= PERIOD_NS);
        prop_assert!(wires.shortest_hold >= 300);
        if stretch_ns == 0 {
            // No slower than the wires.
            let longest = wires.longest_period;
            prop_assert!(longest <= PERIOD_NS + rise_ns + LOOK_NS, "{longest} ns");
        }
        prop_assert!(wires.level(SCL) && wires.level(SDA));
    }
}

/// From any bit on SDA stays low, which acknowledges everything and reads as
/// zeros.
#[test]
fn data_stuck_low_is_never_taken_for_an_answer() {
    let parts = [Part::Write(vec![7, 8]), Part::Read(2), Part::Write(vec![9])];
    // START and three bytes, START and three, START and two.
    let ends = [28, 28 + 28, 28 + 28 + 19];
    for fall in 1..=ends[2] {
        let (mut bus, wires) = bus();
        wires.borrow_mut().stuck = Some((SDA, fall));
        assert_eq!(run(&mut bus, &parts), Err(Error::DataLow), "{fall}");
        // Seen at the next START or STOP.
        let end = ends.into_iter().find(|&end| fall <= end);
        assert_eq!(Some(wires.borrow().falls), end);
        assert_eq!(wires.borrow().controller, [true; 2]);
        // Free again.
        wires.borrow_mut().stuck = None;
        assert_eq!(run(&mut bus, &parts).map(|read| read.len()), Ok(2));
    }
}

/// The register of a packet is written, its 135 bytes are read.
#[test]
fn a_packet_of_135_bytes_takes_3_to_4_ms() {
    for (rise_ns, microseconds) in [(0, 3116), (300, 3490)] {
        let (mut bus, wires) = bus();
        wires.borrow_mut().rise_ns = rise_ns;
        let before = wires.borrow().now_ns;
        bus.write_read(ADDRESS, &[0x20], &mut [0; 135]).unwrap();
        let took = wires.borrow().now_ns - before;
        assert_eq!(took.div_ceil(1000), microseconds);
        // 138 bytes of 9 bits, START twice, STOP once.
        assert!(took <= (138 * 9 + 4) * (PERIOD_NS + rise_ns + LOOK_NS));
    }
}

#[test]
fn nobody_there_is_said_at_the_address_and_stops() {
    let (mut bus, wires) = bus();
    assert_eq!(bus.write(0x42, &[1, 2]), Err(Error::NoDevice));
    let address = Seen::Address(0x42, false);
    assert_eq!(wires.borrow().seen, [Seen::Start, address, Seen::Stop]);
    // And the next works.
    assert_eq!(bus.write(ADDRESS, &[3]), Ok(()));
}

#[test]
fn a_byte_not_taken_ends_the_transaction() {
    let (mut bus, wires) = bus();
    wires.borrow_mut().takes = 2;
    assert_eq!(bus.write(ADDRESS, &[1, 2, 3]), Err(Error::NotAcknowledged));
    let seen = wires.borrow().seen.clone();
    assert_eq!(seen[2..], [Seen::Written(1), Seen::Written(2), Seen::Stop]);
}

/// The address and the byte are acknowledged, and the clock is then held.
#[test]
fn a_clock_held_for_24_ms_is_waited_for_and_one_held_for_26_ms_is_not() {
    let (mut bus, wires) = bus();
    wires.borrow_mut().stretch_ns = 12_000_000;
    assert_eq!(bus.write(ADDRESS, &[1]), Ok(()));
    wires.borrow_mut().stretch_ns = 13_000_000;
    assert_eq!(bus.write(ADDRESS, &[1]), Err(Error::ClockLow));
    wires.borrow_mut().stretch_ns = 0;
    wires.borrow_mut().wait(20_000_000);
    assert_eq!(bus.write(ADDRESS, &[1]), Ok(()));
}

/// The time a device may hold the clock is one for all bytes of a transaction,
/// and another for the next.
#[test]
fn a_device_that_holds_the_clock_at_every_byte_is_given_up_after_25_ms() {
    let (mut bus, wires) = bus();
    wires.borrow_mut().stretch_ns = 1_000_000;
    let bytes = [0; 128];
    for _ in 0..2 {
        assert_eq!(bus.write(ADDRESS, &bytes[..23]), Ok(()));
    }
    let before = wires.borrow().now_ns;
    assert_eq!(bus.write(ADDRESS, &bytes), Err(Error::ClockLow));
    let took = wires.borrow().now_ns - before;
    assert!((25_000_000..26_000_000).contains(&took), "{took} ns");
    // As long as it would take without.
    wires.borrow_mut().wait(1_000_000);
    wires.borrow_mut().stretch_ns = 0;
    assert_eq!(bus.write(ADDRESS, &bytes), Ok(()));
}

/// STOP after a byte that is not acknowledged fails as well: the bus is let go of,
/// and the first error is told.
#[test]
fn an_error_of_the_stop_after_an_error_hides_nothing_and_drives_nothing() {
    for wire in [SCL, SDA] {
        for (address, bytes, error) in [
            (0x42, 1, Error::NoDevice),
            (ADDRESS, 2, Error::NotAcknowledged),
        ] {
            let (mut bus, wires) = bus();
            wires.borrow_mut().takes = 1;
            // START, and the bytes with the bit that acknowledges them.
            wires.borrow_mut().stuck = Some((wire, 1 + bytes * 9));
            assert_eq!(bus.write(address, &[1, 2]), Err(error));
            assert_eq!(wires.borrow().controller, [true; 2]);
            assert!(!wires.borrow().seen.contains(&Seen::Stop));
            wires.borrow_mut().stuck = None;
            wires.borrow_mut().takes = usize::MAX;
            assert_eq!(bus.write(ADDRESS, &[1, 2]), Ok(()));
        }
    }
}

#[test]
fn a_bus_that_nothing_pulls_up_costs_no_more_than_its_limit() {
    for (wire, error) in [(SCL, Error::ClockLow), (SDA, Error::DataLow)] {
        let (mut bus, wires) = bus();
        wires.borrow_mut().hold(wire, true);
        let before = wires.borrow().now_ns;
        assert_eq!(bus.write(ADDRESS, &[1]), Err(error));
        let took = wires.borrow().now_ns - before;
        assert!(took <= 25_100_000, "{took} ns");
        // Plugged in again.
        wires.borrow_mut().hold(wire, false);
        assert_eq!(bus.write(ADDRESS, &[1]), Ok(()));
    }
}

/// The controller was reset while the device sent a 0.
#[test]
fn a_device_stuck_in_a_byte_is_clocked_free() {
    for bits in 1..=8 {
        let (mut bus, wires) = bus();
        wires.borrow_mut().hold(SDA, true);
        wires.borrow_mut().phase = Phase::Send(0, bits);
        let mut byte = [0xAA];
        assert_eq!(bus.write_read(ADDRESS, &[7], &mut byte), Ok(()));
        assert_eq!(byte, [0]);
        let expected = expected(&[Part::Write(vec![7]), Part::Read(1)]);
        assert!(wires.borrow().seen.ends_with(&expected));
    }
}
