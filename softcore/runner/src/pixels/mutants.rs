//! Faults that the scenes have to find: each a text of the pixel processor's Verilog that is
//! there once, and what stands there instead.

use anyhow::{Result, bail};

/// One of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mutant {
    /// Of `softcore/rtl/pixels`, without `.v`.
    pub file: &'static str,
    pub from: &'static str,
    pub to: &'static str,
}

impl Mutant {
    /// The file's text with the fault.
    pub fn apply(&self, text: &str) -> Result<String> {
        match text.matches(self.from).count() {
            1 => Ok(text.replacen(self.from, self.to, 1)),
            times => bail!("`{}` is {times} times in {}.v", self.from, self.file),
        }
    }
}

const fn mutant(file: &'static str, from: &'static str, to: &'static str) -> Mutant {
    Mutant { file, from, to }
}

/// All of them.
pub const MUTANTS: [Mutant; 69] = [
    // Counting: words on their way, valid bits, full counters.
    mutant(
        "bin_counter",
        "b_hit_d <= c_writes &&",
        "b_hit_d <= 1'b0 && c_writes &&",
    ),
    mutant(
        "bin_counter",
        "b_hit_e <= d_writes &&",
        "b_hit_e <= 1'b0 && d_writes &&",
    ),
    mutant(
        "bin_counter",
        "c_hit_d <= c_writes &&",
        "c_hit_d <= 1'b0 && c_writes &&",
    ),
    mutant(
        "bin_counter",
        "b_hit_d ? d_word : b_hit_e",
        "b_hit_e ? e_word : b_hit_d",
    ),
    mutant("bin_counter", "c_fresh <= b_fresh;", "c_fresh <= 0;"),
    mutant("bin_counter", "c_lane[lane] && !is_full", "c_lane[lane]"),
    mutant(
        "bin_counter",
        "is_full = &so_far[10:9]",
        "is_full = &so_far[9:0]",
    ),
    mutant(
        "bin_counter",
        "counted[9:0] | {10{counted[10]}}",
        "counted[9:0] & ~{10{counted[9]}}",
    ),
    mutant(
        "bin_counter",
        "has_row_after & (slot ? live : ~live)",
        "has_row_after & (slot ? ~live : live)",
    ),
    mutant(
        "bin_counter",
        "a_look ? has_row_after &",
        "a_look ? has_row &",
    ),
    mutant(
        "bin_counter",
        "if (reset) has_row <= 0;",
        "if (reset) has_row[0] <= 0;",
    ),
    mutant(
        "bin_counter",
        "e_full0 <= histogram[0].counted[10];",
        "e_full0 <= &histogram[0].counted[9:0];",
    ),
    mutant(
        "bin_counter",
        "|| b_is_read && b_fresh ||",
        "|| b_is_read && c_fresh ||",
    ),
    mutant("bin_counter", "|| c_is_read && c_fresh;", ";"),
    mutant(
        "bin_counter",
        "read_hit ? e_word : copy",
        "read_hit ? d_word : copy",
    ),
    mutant(
        "word_bin",
        "3'd5: count = word[65:55];",
        "3'd5: count = word[76:66];",
    ),
    // Peak and maxima.
    mutant(
        "peak_keeper",
        "key = {f_count, ~f_bin}",
        "key = {f_count, f_bin}",
    ),
    mutant(
        "peak_keeper",
        "f_counts && key > f_state[16:0]",
        "f_counts && key[16:7] > f_state[16:7]",
    ),
    mutant(
        "peak_keeper",
        "&& f_count > highest",
        "&& f_count > highest + 10'd1",
    ),
    mutant(
        "peak_keeper",
        "f_quadrant <= 4'd1 << e_quadrant;",
        "f_quadrant <= 4'd1 << {e_quadrant[0], e_quadrant[1]};",
    ),
    mutant(
        "peak_keeper",
        "f_valid && f_pixel == e_pixel ? f_next : states[e_pixel]",
        "states[e_pixel]",
    ),
    mutant(
        "peak_keeper",
        "slot ? valid_after & live : valid_after & ~live",
        "slot ? valid & live : valid & ~live",
    ),
    mutant(
        "peak_keeper",
        "slot ? seen_after & live : seen_after & ~live",
        "slot ? seen & live : seen & ~live",
    ),
    mutant(
        "peak_keeper",
        "f_count = slot ? f_count1 : f_count0",
        "f_count = slot ? f_count0 : f_count1",
    ),
    mutant(
        "peak_keeper",
        "{15'd0, !(&came)}",
        "{15'd0, f_counts && !(&came)}",
    ),
    mutant(
        "peak_keeper",
        "{23'd0, f_counts && f_full && !(&lost)}",
        "{23'd0, f_counts && !(&lost)}",
    ),
    // States put aside.
    mutant(
        "peak_keeper",
        "if (f_valid && !is_aside[f_pixel]) aside",
        "if (f_valid) aside",
    ),
    mutant(
        "peak_keeper",
        "if (f_look) is_aside <= 0;",
        "if (f_look && !f_valid) is_aside <= 0;",
    ),
    mutant(
        "peak_keeper",
        "f_live = live[f_pixel] ? kept[1].f_state",
        "f_live = !live[f_pixel] ? kept[1].f_state",
    ),
    mutant(
        "peak_keeper",
        "is_aside[scan_pixel] ? aside[scan_pixel]",
        "is_aside[scan_pixel] && !(&scan_pixel) ? aside[scan_pixel]",
    ),
    // The rule.
    mutant(
        "decision",
        "{1'b0, peak_bin} >= middle",
        "{1'b0, peak_bin} > middle",
    ),
    mutant(
        "decision",
        "level[0] <= first < second ?",
        "level[0] <= first > second ?",
    ),
    mutant("decision", "first_peak >= minimum", "first_peak > minimum"),
    mutant(
        "decision",
        "root[step] | (less[step][10] ? 5'd0 :",
        "root[step] | (less[step][10] || less[step] == 11'd0 ? 5'd0 :",
    ),
    mutant(
        "decision",
        "{2'd0, excess} > above[STEPS + 1]",
        "{2'd0, excess} >= above[STEPS + 1]",
    ),
    mutant(
        "decision",
        "(root[step][STEPS - step] ?",
        "(root[step][STEPS - step] && step != 5 ?",
    ),
    // Looks, exposures, decisions put off.
    mutant(
        "look_scan",
        "is_next <= x <= 16'd1;",
        "is_next <= x <= 16'd2;",
    ),
    mutant(
        "look_scan",
        "is_next <= until_due == 16'd1;",
        "is_next <= until_due == 16'd2;",
    ),
    mutant(
        "look_scan",
        "requesting_at_look <= requesting;",
        "requesting_at_look <= 0;",
    ),
    mutant(
        "look_scan",
        "is_early <= exposure <= l1;",
        "is_early <= exposure < l1;",
    ),
    mutant(
        "look_scan",
        "is_long <= exposure >= l2;",
        "is_long <= exposure > l2;",
    ),
    mutant("look_scan", "sum[15:0] | {16{sum[16]}}", "sum[15:0]"),
    mutant(
        "look_scan",
        "&& {rest[32:17], 1'b0} > {1'b0, exposure}",
        "&& {rest[32:17], 1'b0} >= {1'b0, exposure}",
    ),
    mutant(
        "look_scan",
        "if (ends) live[o_pixel]",
        "if (fires) live[o_pixel]",
    ),
    mutant(
        "look_scan",
        "!ends && (waits || is_deferred[o_pixel])",
        "!ends && waits",
    ),
    mutant(
        "look_scan",
        "ends || reset ? 16'd0 : o_exposure",
        "fires || reset ? 16'd0 : o_exposure",
    ),
    mutant(
        "look_scan",
        "deferred <= acts && !is_long && waits;",
        "deferred <= acts && waits;",
    ),
    mutant(
        "look_scan",
        "full_ended <= ends ? o_full",
        "full_ended <= fires ? o_full",
    ),
    mutant(
        "look_scan",
        "if (is_scanned && !found && !reading) begin",
        "if (scanning && is_last) begin",
    ),
    // The bins beside the peak.
    mutant(
        "event_reader",
        "count = t_ended - t_since",
        "count = t_ended",
    ),
    mutant(
        "event_reader",
        "ended = s_live ? read_word0",
        "ended = !s_live ? read_word0",
    ),
    mutant(
        "event_reader",
        "q_neighbour >= gate_first",
        "q_neighbour > gate_first",
    ),
    mutant(
        "event_reader",
        "q_neighbour < gate_end",
        "q_neighbour <= gate_end",
    ),
    mutant(
        "event_reader",
        "put_clipped <= !t_inside || !left_inside;",
        "put_clipped <= !t_inside;",
    ),
    mutant(
        "event_reader",
        "counted[9:0] | {10{counted[10]}}",
        "counted[9:0]",
    ),
    mutant(
        "event_reader",
        "host_word[10*lane +: 10] = counted",
        "host_word[10*lane +: 10] = ~counted",
    ),
    // The queue, words, registers.
    mutant(
        "event_queue",
        "if (put) next <= next + 1'b1;",
        "if (put && !take) next <= next + 1'b1;",
    ),
    mutant(
        "event_packer",
        "is_sent && sent_high == high ? EVENT",
        "is_sent ? EVENT",
    ),
    mutant(
        "event_packer",
        "remainder <= {2'd0, distance, 9'd0} + {9'd0, sum};",
        "remainder <= {2'd0, distance, 9'd0};",
    ),
    mutant(
        "pixel_registers",
        "host_comes <= host_on_way[1];",
        "host_comes <= host_on_way[0];",
    ),
    mutant(
        "pixel_processor",
        "a_quadrant <= bin < gate_middle ?",
        "a_quadrant <= bin <= gate_middle ?",
    ),
    mutant("pixel_processor", "bin >= gate_fourth", "bin > gate_fourth"),
    mutant(
        "pixel_processor",
        "is_clipped, &count}",
        "&count, is_clipped}",
    ),
    mutant(
        "pixel_processor",
        "wire is_gated = bin >= gate_first && bin < gate_end;",
        "wire is_gated = bin > gate_first && bin < gate_end;",
    ),
    mutant(
        "pixel_processor",
        "strayed <= i_valid && is_stray;",
        "strayed <= i_valid && is_stray && !is_rejected;",
    ),
    mutant(
        "pixel_processor",
        ".cycle_high(event_cycle[63:16])",
        ".cycle_high(48'd0)",
    ),
    mutant("pixel_registers", "if (write && !run)", "if (write)"),
    mutant(
        "pixel_registers",
        "8'h08: wb_dat_o <= {31'd0, event_waiting && !packs};",
        "8'h08: wb_dat_o <= 0;",
    ),
    mutant(
        "pixel_registers",
        "8'h0d: wb_dat_o <= {6'd0, event_right, 6'd0, event_left};",
        "8'h0d: wb_dat_o <= {6'd0, event_left, 6'd0, event_right};",
    ),
];
