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
pub const MUTANTS: [Mutant; 124] = [
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
    // Start and stop: what a run leaves behind.
    mutant(
        "pixel_processor",
        "i_valid <= photon_valid && running;",
        "i_valid <= photon_valid;",
    ),
    mutant(
        "pixel_processor",
        "i_end <= cycle_end && running;",
        "i_end <= cycle_end;",
    ),
    mutant(
        "pixel_processor",
        "running <= run && (running || emptied[PIXELS_LOG2]) && !reset;",
        "running <= run && !reset;",
    ),
    mutant(
        "pixel_processor",
        "&& (running || emptied[PIXELS_LOG2]) && !reset;",
        "&& (running || emptied[PIXELS_LOG2]);",
    ),
    mutant(
        "pixel_processor",
        "if (running || reset) emptied <= 0;",
        "if (reset) emptied <= 0;",
    ),
    mutant(
        "pixel_processor",
        ".reset(stopped), .live(live),\n        .a_valid",
        ".reset(reset), .live(live),\n        .a_valid",
    ),
    mutant(
        "pixel_processor",
        ".reset(stopped), .live(live),\n        .e_valid",
        ".reset(reset), .live(live),\n        .e_valid",
    ),
    mutant(
        "pixel_processor",
        ".reset(stopped), .live(live), .gate_first",
        ".reset(reset), .live(live), .gate_first",
    ),
    mutant(
        "pixel_processor",
        ".reset(stopped), .emptied(",
        ".reset(reset), .emptied(",
    ),
    mutant(
        "pixel_processor",
        ".reset(stopped),\n        .put(put),",
        ".reset(reset),\n        .put(put),",
    ),
    mutant(
        "pixel_processor",
        ".reset(stopped), .enabled(packs)",
        ".reset(reset), .enabled(packs)",
    ),
    mutant(
        "pixel_processor",
        ".emptied(emptied[PIXELS_LOG2-1:0])",
        ".emptied({PIXELS_LOG2{1'b0}})",
    ),
    mutant("look_scan", "found <= fires && !reset;", "found <= fires;"),
    mutant("look_scan", "            deferred <= 0;\n", ""),
    mutant("look_scan", "            on_way <= 0;\n", ""),
    mutant("look_scan", "            n_pixel <= 0;\n", ""),
    mutant("event_packer", "            is_sent <= 0;\n", ""),
    mutant(
        "event_packer",
        "            state <= IDLE;\n            is_sent",
        "            is_sent",
    ),
    mutant("event_queue", "            next <= 0;\n", ""),
    mutant(
        "pixel_processor",
        ".begins(begins), .x(x)",
        ".begins(1'b0), .x(x)",
    ),
    // How the modules are joined: ports swapped, a clock too late or early, too narrow.
    mutant(
        "pixel_processor",
        ".a_valid(a_valid), .a_counts(a_counts), .a_look(a_look)",
        ".a_valid(a_valid), .a_counts(a_counts), .a_look(look)",
    ),
    mutant(
        "pixel_processor",
        "a_look <= look;",
        "a_look <= look_begins;",
    ),
    mutant(
        "pixel_processor",
        ".cycle_end(i_end)",
        ".cycle_end(cycle_end && running)",
    ),
    mutant(
        "pixel_processor",
        ".look(look), .late(late)",
        ".look(late), .late(look)",
    ),
    mutant(
        "pixel_processor",
        ".e_count0(e_count0), .e_count1(e_count1), .e_full0(e_full0), .e_full1(e_full1),\n        .scan",
        ".e_count0(e_count1), .e_count1(e_count0), .e_full0(e_full0), .e_full1(e_full1),\n        .scan",
    ),
    mutant(
        "pixel_processor",
        ".e_full0(e_full0), .e_full1(e_full1),\n        .scan",
        ".e_full0(e_full1), .e_full1(e_full0),\n        .scan",
    ),
    mutant(
        "pixel_processor",
        ".scan(scan), .scan_pixel(scan_pixel),\n        .peak_count(peak_count), .peak_bin(peak_bin), .maxima",
        ".scan(scan), .scan_pixel(found_pixel),\n        .peak_count(peak_count), .peak_bin(peak_bin), .maxima",
    ),
    mutant(
        "pixel_processor",
        ".live(live), .gate_first",
        ".live(~live), .gate_first",
    ),
    mutant(
        "pixel_processor",
        ".alpha(alpha), .minimum(minimum), .middle",
        ".alpha({6'd0, alpha[9:0]}), .minimum(minimum), .middle",
    ),
    mutant(
        "pixel_processor",
        ".alpha(alpha), .minimum(minimum), .middle",
        ".alpha({1'b0, alpha[14:0]}), .minimum(minimum), .middle",
    ),
    mutant(
        "pixel_processor",
        ".alpha(alpha), .minimum(minimum), .middle",
        ".alpha(alpha), .minimum({1'b0, minimum[8:0]}), .middle",
    ),
    mutant(
        "pixel_processor",
        ".event_cycle_high(event_cycle[63:16])",
        ".event_cycle_high(48'd0)",
    ),
    mutant(
        "pixel_processor",
        ".minimum(minimum), .middle(gate_middle)",
        ".minimum({7'd0, minimum[2:0]}), .middle(gate_middle)",
    ),
    mutant(
        "pixel_processor",
        ".middle(gate_middle),\n        .peak_count",
        ".middle(gate_second),\n        .peak_count",
    ),
    mutant(
        "pixel_processor",
        ".x(x), .l1(l1), .l2(l2), .is_one_hit",
        ".x({8'd0, x[7:0]}), .l1(l1), .l2(l2), .is_one_hit",
    ),
    mutant(
        "pixel_processor",
        ".l1(l1), .l2(l2), .is_one_hit(is_one_hit),\n        .cycle_end",
        ".l1(l2), .l2(l1), .is_one_hit(is_one_hit),\n        .cycle_end",
    ),
    mutant(
        "pixel_processor",
        ".is_one_hit(is_one_hit),\n        .cycle_end",
        ".is_one_hit(1'b0),\n        .cycle_end",
    ),
    mutant(
        "pixel_processor",
        ".photons(photons), .full(full),\n        .background",
        ".photons({6'd0, photons[9:0]}), .full(full),\n        .background",
    ),
    mutant(
        "pixel_processor",
        ".full(full),\n        .background",
        ".full({12'd0, full[11:0]}),\n        .background",
    ),
    mutant(
        "pixel_processor",
        ".reading(reading), .live",
        ".reading(1'b0), .live",
    ),
    mutant(
        "pixel_processor",
        "assign taken_pixel = pixel;",
        "reg [PIXELS_LOG2-1:0] left_pixel;\n    always @(posedge clk) left_pixel <= pixel;\n    assign taken_pixel = left_pixel;",
    ),
    mutant(
        "pixel_processor",
        "assign taken = take;",
        "assign taken = event_leaves;",
    ),
    mutant(
        "pixel_processor",
        "assign take = register_takes || packer_takes;",
        "assign take = packer_takes;",
    ),
    mutant(
        "pixel_processor",
        ".found_rest({found_piled_up, found_deferred,",
        ".found_rest({found_deferred, found_piled_up,",
    ),
    mutant(
        "pixel_processor",
        "found_exposure, found_background, found_count}),",
        "{8'd0, found_exposure[7:0]}, found_background, found_count}),",
    ),
    mutant(
        "pixel_processor",
        ".read_word0(read_word0), .read_word1(read_word1),\n        .put",
        ".read_word0(read_word1), .read_word1(read_word0),\n        .put",
    ),
    mutant(
        "pixel_processor",
        ".put_left(put_left), .put_right(put_right)",
        ".put_left(put_right), .put_right(put_left)",
    ),
    mutant(
        "pixel_processor",
        ".host_address(host_address), .host_taken(host_taken),\n        .host_word(host_word)\n    );\n\n    // The events",
        ".host_address(read_address), .host_taken(host_taken),\n        .host_word(host_word)\n    );\n\n    // The events",
    ),
    mutant(
        "pixel_processor",
        ".in({scan_cycle, put_clipped,",
        ".in({cycle, put_clipped,",
    ),
    mutant(
        "pixel_processor",
        ".left(left), .right(right),\n        .cycle_high",
        ".left(right), .right(left),\n        .cycle_high",
    ),
    mutant(
        "pixel_processor",
        ".event_left(left), .event_right(right)",
        ".event_left(right), .event_right(left)",
    ),
    mutant(
        "pixel_processor",
        "event_cycle[15:0], exposure,",
        "cycle[15:0], exposure,",
    ),
    mutant(
        "pixel_processor",
        "{was_late, look_begins,",
        "{look_begins, was_late,",
    ),
    mutant(
        "pixel_processor",
        "expired_deferred, expired, deferred, found,",
        "expired, expired_deferred, deferred, found,",
    ),
    mutant(
        "pixel_processor",
        "strayed, gated_out, rejected, counted}",
        "strayed, rejected, gated_out, counted}",
    ),
];
