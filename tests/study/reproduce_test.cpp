// The papers' figures: what is printed is typed from the papers, what the formulas give is computed by hand, and each
// simulated time is the span of its trace.
#include "berth/study/reproduce.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <chrono>
#include <string>
#include <vector>

#include <algorithm>
#include <set>

#include "berth/study/words.hpp"
#include "berth/trace/candump.hpp"

namespace berth::study {
namespace {

using namespace std::chrono_literals;

const Figures& as_published() {
  static const Figures figures = reproduce({});
  return figures;
}

const Row& row(const Figures& figures, unsigned paper, const std::string& part) {
  const auto found = std::ranges::find_if(
      figures.rows, [&](const Row& r) { return r.paper == paper && r.what.find(part) != std::string::npos; });
  EXPECT_NE(found, figures.rows.end()) << part;
  static const Row none;
  return found == figures.rows.end() ? none : *found;
}

const trace::Trace* trace_of(const Figures& figures, const std::string& name) {
  const auto found = std::ranges::find_if(figures.traces, [&](const NamedTrace& t) { return t.name == name; });
  return found == figures.traces.end() ? nullptr : &found->trace;
}

// S1.40, S1.42, S1.43, S1.44, S1.47: by hand from the paper's conditions, 20 us a bit.
TEST(Reproduce, FormulasOfPaper1) {
  const auto& f = as_published();
  EXPECT_EQ(row(f, 1, "guarded").published, 0.190);
  EXPECT_NEAR(*row(f, 1, "guarded").formula, 30 * (0.0030 + 0.0032) + 0.004, 1e-9);
  EXPECT_EQ(row(f, 1, "collect").published, 0.0301);
  EXPECT_NEAR(*row(f, 1, "collect").formula, 0.004 + 9 * 0.0029, 1e-9);
  EXPECT_EQ(row(f, 1, "30 slaves by RAND").published, 11.2);
  EXPECT_NEAR(*row(f, 1, "30 slaves by RAND").formula, 30 * (8 * 0.0447 + 0.0124) + 0.0447, 1e-9);
  EXPECT_EQ(row(f, 1, "by AND").published, 16.09);
  EXPECT_NEAR(*row(f, 1, "by AND").formula, 30 * (12 * 0.0437 + 0.0104) + 0.0437, 1e-9);
  EXPECT_EQ(row(f, 1, "binding").published, 1.15);
  EXPECT_NEAR(*row(f, 1, "binding").formula, 30 * 0.038, 1e-9);
}

// S2.3, S2.7, S2.16, S2.18.
TEST(Reproduce, FormulasOfPaper2) {
  const auto& f = as_published();
  EXPECT_EQ(row(f, 2, "Fastscan").published, 1.28);
  EXPECT_NEAR(*row(f, 2, "Fastscan").formula, 1.28, 1e-9);
  EXPECT_EQ(row(f, 2, "29 identifier bits").published, 0.44);
  EXPECT_NEAR(*row(f, 2, "29 identifier bits").formula, 0.448276, 1e-6);
  EXPECT_EQ(row(f, 2, "extended identifiers").published, 0.000015);
  EXPECT_NEAR(*row(f, 2, "extended identifiers").formula, 0.0000152588, 1e-10);
  EXPECT_EQ(row(f, 2, "Figure 2").published, 0.282);
  EXPECT_NEAR(*row(f, 2, "Figure 2").formula, 0.275, 1e-9);
  EXPECT_EQ(row(f, 2, "Table 4").published, 0.562);
}

// S4.3, S4.7, S4.16, S4.17: 132 and 9 requests of 135 bits at 125 kbit/s (1.08 ms) and 20 ms; then four LSS frames and
// the switch (5.4 ms), 0.5 + 5 + 5 ms of the device and a boot-up message of 65 bits (0.52 ms).
TEST(Reproduce, FormulasOfPaper4) {
  const auto& f = as_published();
  EXPECT_EQ(row(f, 4, "128 bits").published, 1.25);
  EXPECT_NEAR(*row(f, 4, "128 bits").formula, 1.28, 1e-9);
  EXPECT_EQ(row(f, 4, "Table 1").published, 2.78);
  EXPECT_NEAR(*row(f, 4, "Table 1").formula, 132 * 0.02108 + 0.01642, 1e-6);
  EXPECT_EQ(row(f, 4, "Table 2").published, 0.210);
  EXPECT_NEAR(*row(f, 4, "Table 2").formula, 9 * 0.02108 + 0.01642, 1e-6);
  EXPECT_EQ(row(f, 4, "100 ms").published, 0.100);
}

// S3.16: the numbers that the paper prints. S3.29: 2^(d+1) - 1 accesses and 2^d, and as many counted on the bus; the
// paper itself says three and two.
TEST(Reproduce, NumbersOfPaper3) {
  const auto& f = as_published();
  EXPECT_TRUE(f.wrong.empty());
  EXPECT_EQ(row(f, 3, "figure 7").published, 4195872914689.0);
  EXPECT_EQ(row(f, 3, "figure 8").published, 260144641.0);
  EXPECT_EQ(row(f, 3, "figure 9").published, 16129.0);
  unsigned accesses = 0;
  for (const auto& r : f.rows) {
    if (r.paper != 3) continue;
    if (r.published) {
      EXPECT_EQ(r.published, r.formula) << r.what;
    }
    if (std::string_view(r.unit) != "accesses") continue;
    EXPECT_EQ(r.counted, r.formula) << r.what;
    ++accesses;
  }
  EXPECT_EQ(accesses, 12U);
  EXPECT_EQ(row(f, 3, "the first upload beneath 6 gateways").formula, 127);
  EXPECT_EQ(row(f, 3, "a further upload beneath 6 gateways").formula, 64);
}

// The simulation on the exact bus is near to what the papers print, where its note does not say otherwise.
TEST(Reproduce, SimulatedIsNearThePapers) {
  const auto& f = as_published();
  EXPECT_NEAR(*row(f, 4, "Table 1").simulated, 2.78, 0.01);
  EXPECT_NEAR(*row(f, 4, "Table 2").simulated, 0.210, 0.01);
  EXPECT_NEAR(*row(f, 1, "30 slaves by RAND").simulated, 11.2, 0.6);
  EXPECT_NEAR(*row(f, 1, "by AND").simulated, 16.09, 0.2);
  EXPECT_NEAR(*row(f, 2, "Figure 2").simulated, 0.282, 0.008);
  EXPECT_NEAR(*row(f, 2, "Table 4").simulated, 0.562, 0.010);
}

// The issue: each simulated row names a recorded trace, and the span of the written log is the simulated time.
TEST(Reproduce, EachSimulatedTimeIsTheSpanOfItsTrace) {
  const auto& f = as_published();
  unsigned seen = 0;
  std::set<std::string> names;
  for (const auto& each : f.traces) EXPECT_TRUE(names.insert(each.name).second) << each.name << " twice";
  for (const auto& r : f.rows) {
    EXPECT_FALSE(r.note.empty()) << r.what;
    EXPECT_EQ(r.simulated.has_value(), !r.trace.empty()) << r.what;
    if (r.trace.empty()) continue;
    const auto* const trace = trace_of(f, r.trace);
    ASSERT_NE(trace, nullptr) << r.trace;
    const auto reading = trace::read_candump(trace::write_candump(*trace), r.trace);
    ASSERT_TRUE(reading.findings.empty());
    const auto span = trace::statistics(reading.trace, 0).span();
    EXPECT_NEAR(std::chrono::duration<double>(span).count(), *r.simulated, 1.5e-6) << r.what;
    EXPECT_FALSE(r.marks.empty());
    ++seen;
  }
  EXPECT_EQ(seen, 12U);
}

// Berth's planners find faster. Where the row goes on until a node-ID is bound Berth does more than the paper (stores,
// asks whether it is free, identifies), and no row says that it is faster.
TEST(Reproduce, BerthFindsFaster) {
  unsigned seen = 0;
  unsigned binding = 0;
  for (const auto& r : as_published().rows) {
    if (!r.berth) continue;
    ++seen;
    const bool binds = r.note.find("places::Binder") != std::string::npos;
    binding += binds;
    if (binds) continue;
    EXPECT_LT(*r.berth, *r.simulated) << r.what;
  }
  EXPECT_EQ(seen, 8U);
  EXPECT_EQ(binding, 4U);
}

// S1.29, S1.47, S1.53: what is printed as Berth's binding is what `places::Binder` does on the wire, slave by slave:
// all to waiting before the selection, the node-ID asked, configured, stored, and all to waiting again, so that the
// slave boots under it and is identified there.
TEST(Reproduce, BerthsBindingIsTheBindersOwn) {
  const auto& f = as_published();
  const auto* const trace = trace_of(f, "paper1-binding-berth");
  ASSERT_NE(trace, nullptr);
  std::vector<std::string> steps;
  std::vector<unsigned> booted;
  for (const auto& e : trace->entries) {
    const auto& frame = e.frame;
    if (frame.id == 0x7E5 && !frame.extended) steps.push_back(raw(frame).substr(0, 5));
    if (frame.id > 0x700 && frame.id < 0x77F && !frame.remote && frame.data[0] == 0) booted.push_back(frame.id - 0x700);
    if (frame.id > 0x600 && frame.id < 0x680 && frame.data[1] == 0x18 && frame.data[3] == 4)
      steps.push_back("1018h:04");
  }
  // The proof that one slave alone is selected: the first on a bus by all parts of the address, the others by what they
  // differ in, the serial number.
  const auto proof = [](unsigned i) { return i == 0 ? 4U : 1U; };
  ASSERT_EQ(steps.size(), 30 * 10U + 4U + 29U);
  ASSERT_EQ(booted.size(), 30U);
  for (unsigned i = 0; i < 30; ++i) {
    const auto* step = &steps[i == 0 ? 0U : 14U + (i - 1) * std::size_t{11}];
    EXPECT_EQ(step[0], "04 00") << i;
    EXPECT_EQ(step[4].substr(0, 2), "43") << i;
    EXPECT_EQ(step[5].substr(0, 2), i == 0 ? "5A" : "5D") << i;
    step += proof(i);
    EXPECT_EQ(step[4].substr(0, 2), "5D") << i;
    EXPECT_EQ(step[5].substr(0, 2), "5E") << i;
    EXPECT_EQ(step[6], fmt::format("11 {:02X}", i + 1)) << i;
    EXPECT_EQ(step[7].substr(0, 2), "17") << i;
    EXPECT_EQ(step[8], "04 00") << i;
    EXPECT_EQ(step[9], "1018h:04") << i;
    EXPECT_EQ(booted[i], i + 1);
  }
}

// A figure whose devices are not what the run was to make of them is empty, and the reason stands beside it.
TEST(Reproduce, EveryRunIsHeldAgainstItsDevices) {
  EXPECT_TRUE(as_published().wrong.empty()) << as_published().wrong.front();
  for (const auto& name : listings()) EXPECT_TRUE(listing(name, {})->wrong.empty()) << name;
  // Answers that take longer than the paper's windows: slaves are missed, and the row does not pretend otherwise.
  Figures late;
  reproduce_paper4({.latency = 25ms}, late);
  EXPECT_FALSE(late.wrong.empty());
  EXPECT_FALSE(row(late, 4, "Table 1").simulated);
}

// S1.45, S1.46: AND's answers are base frames of eight bytes, as docs/and.md has them.
TEST(Reproduce, AndAnswersHaveEightBytes) {
  const auto& f = as_published();
  unsigned answers = 0;
  for (const auto& e : trace_of(f, "paper1-and")->entries) {
    if (e.frame.id < 0x7A0 || e.frame.id > 0x7BF) continue;
    EXPECT_EQ(e.frame.size, 8U);
    EXPECT_FALSE(e.frame.extended);
    ++answers;
  }
  EXPECT_GT(answers, 30 * 12U);
  EXPECT_EQ(row(f, 1, "by AND").note.find("without data"), std::string::npos);
}

// `--bitrate` and `--latency` move formula and simulation, each by itself: S1.41's formula with other numbers by hand.
TEST(Reproduce, OtherConditions) {
  Figures fast;
  reproduce_paper1({.bit_rate = 100'000, .latency = 2ms}, fast);
  // 10 us a bit: T_collect >= 2 + 9 x 1.45 = 15.05, taken as 20 ms; phase 1.85 + 20 + 1; direct 1.85 + 2 + 1.85 + 1.
  const auto& rand = row(fast, 1, "30 slaves by RAND");
  EXPECT_NEAR(*rand.formula, 30 * (8 * 0.02285 + 0.0067) + 0.02285, 1e-9);
  ASSERT_TRUE(rand.simulated);
  EXPECT_NEAR(*rand.simulated, *rand.formula, 0.5);
  EXPECT_NE(*rand.simulated, *rand.formula);
  EXPECT_EQ(rand.published, 11.2) << "what the paper prints stays";
  const auto& guard = row(fast, 1, "guarded");
  EXPECT_NEAR(*guard.formula, 30 * (0.0015 + 0.0016) + 0.002, 1e-9);
  EXPECT_LT(*guard.simulated, *row(as_published(), 1, "guarded").simulated);
}

// S4.14: 229 messages; the rows that the paper prints, as it prints them.
TEST(Listing, Paper4Table1) {
  const auto table = message_table(listing("paper4-table1", {})->trace);
  ASSERT_EQ(table.size(), 230U) << "head and 229 messages";
  EXPECT_EQ(table[0], "Msg\tID\tDetails\tRaw Message");
  EXPECT_EQ(table[1], "1\t0x7E5\tLSS Fastscan: Checking for new nodes\t51 00 00 00 00 80 00 00");
  EXPECT_EQ(table[2], "2\t0x7E4\tIdentify Servant\t4F 00 00 00 00 00 00 00");
  EXPECT_EQ(table[5], "5\t0x7E5\tLSS Fastscan: Vendor ID - Checking bits 30 - 31\t51 00 00 00 00 1E 00 00");
  EXPECT_EQ(table[56], "56\t0x7E5\tLSS Fastscan: Vendor ID - Checking bits 0 - 31\t51 41 53 35 01 00 00 01");
  EXPECT_EQ(table[115], "115\t0x7E5\tLSS Fastscan: Product Code - Checking bits 0 - 31\t51 03 00 47 04 00 01 02");
  EXPECT_EQ(table[176], "176\t0x7E5\tLSS Fastscan: Revision Nr. - Checking bits 0 - 31\t51 06 00 02 00 00 02 03");
  EXPECT_EQ(table[179], "179\t0x7E5\tLSS Fastscan: Serial Nr. - Checking bits 30 - 31\t51 00 00 00 80 1E 03 03");
  EXPECT_EQ(table[222], "222\t0x7E5\tLSS Fastscan: Serial Nr. - Checking bits 0 - 31\t51 0D F0 ED FE 00 03 04");
  EXPECT_EQ(table[224], "224\t0x7E5\tConfigure Node ID - NID: 0x03\t11 03 00 00 00 00 00 00");
  EXPECT_EQ(table[225], "225\t0x7E4\tConfigure Node ID - Success\t11 00 00 00 00 00 00 00");
  EXPECT_EQ(table[227], "227\t0x7E4\tStore Configuration - Success\t17 00 00 00 00 00 00 00");
  EXPECT_EQ(table[228], "228\t0x7E5\tSwitch Mode Global - Operation Mode\t04 00 00 00 00 00 00 00");
  EXPECT_EQ(table[229], "229\t0x703\tBoot up of node 3\t00");
}

// S4.17: all 32 messages; feedback has no data.
TEST(Listing, Paper4Table2) {
  const auto table = message_table(listing("paper4-table2", {})->trace);
  ASSERT_EQ(table.size(), 33U);
  EXPECT_EQ(table[2], "2\t0x1F900135\tLSS Fastscan: Bits 16 - 31 are 0x0135\t");
  EXPECT_EQ(table[3], "3\t0x7E4\tIdentify Servant\t4F 00 00 00 00 00 00 00");
  EXPECT_EQ(table[4], "4\t0x7E5\tLSS Fastscan: Vendor ID - Checking bits 16 - 31\t51 00 00 35 01 10 00 00");
  EXPECT_EQ(table[5], "5\t0x1F915341\tLSS Fastscan: Bits 0 - 15 are 0x5341\t");
  EXPECT_EQ(table[23], "23\t0x1F91F00D\tLSS Fastscan: Bits 0 - 15 are 0xF00D\t");
  EXPECT_EQ(table[25], "25\t0x7E5\tLSS Fastscan: Serial Nr. - Checking bits 0 - 31\t51 0D F0 ED FE 00 03 04");
  EXPECT_EQ(table[32], "32\t0x703\tBoot up of node 3\t00");
}

// S1.49: DIRS 80 08 00 05 asks s2 alone, after phases whose masks are the chunks of its address.
TEST(Listing, Paper1Figure9) {
  const auto trace = listing("paper1-figure9", {})->trace;
  std::vector<std::string> requests;
  for (const auto& e : trace.entries) {
    if (e.frame.key() == (can::extended_flag | 0x1F94'0000)) requests.push_back(raw(e.frame));
  }
  ASSERT_EQ(requests.size(), 46U) << "nine for each of five slaves, and phase 0 that nobody answers";
  EXPECT_EQ(requests[0], "80 00 00 00");
  EXPECT_EQ(requests[1], "80 01 00 00");
  EXPECT_EQ(requests[4], "80 04 00 01");
  EXPECT_EQ(requests[8], "80 08 00 05");
  EXPECT_EQ(requests[45], "80 00 00 00");
}

// S2.16, S2.18: first and last lines as the paper prints them; where both nodes send one byte the lines fall together.
TEST(Listing, Paper2) {
  const auto figure = view_table(listing("paper2-figure2", {})->trace);
  ASSERT_GT(figure.size(), 20U);
  EXPECT_NE(figure[1].find("256/0x100\tID Negotiation\t\tRequest used node-IDs"), std::string::npos) << figure[1];
  EXPECT_NE(figure[2].find("4121/0x1019\tID Negotiation\t\tsub: 1, byte: 0, value: 0x19"), std::string::npos)
      << figure[2];
  const auto table = time_table(listing("paper2-table4", {})->trace);
  ASSERT_GT(table.size(), 40U);
  EXPECT_EQ(table[0], "time\tid\tide\tl\td");
  EXPECT_EQ(table[1], "0.000000\t256/0x100\tEXT\t0");
  EXPECT_NE(table.back().find("1857/0x741\t-\t1\t0x7f"), std::string::npos) << table.back();
}

TEST(Listing, OfAnyOtherNameIsNone) { EXPECT_FALSE(listing("paper3", {})); }

TEST(Words, TellDisFromFeedbackByWhoAskedLast) {
  Interpreter words;
  const auto both = can::Frame::ext(0x1F90'0014, {});
  EXPECT_EQ(words.words(both), "LSS Fastscan: Bits 16 - 31 are 0x0014");
  EXPECT_EQ(words.words(can::Frame::ext(0x1F94'0000, {0x80, 8, 0, 5})), "RAND DIRS: chunk(7) is 0x0005");
  EXPECT_EQ(words.words(both), "RAND DIS: chunk 0x0005");
  EXPECT_EQ(words.words(can::Frame::base(0x7E5, {0x51, 0, 0, 0, 0, 0x80, 0, 0})),
            "LSS Fastscan: Checking for new nodes");
  EXPECT_EQ(words.words(both), "LSS Fastscan: Bits 16 - 31 are 0x0014");
}

TEST(Words, OfCanopen) {
  Interpreter words;
  EXPECT_EQ(words.words(can::Frame::base(0, {1, 0})), "NMT: start, all nodes");
  EXPECT_EQ(words.words(can::Frame::base(0, {0x82, 5})), "NMT: reset communication, node 5");
  EXPECT_EQ(words.words(can::Frame::base(0x705, {0})), "Boot up of node 5");
  EXPECT_EQ(words.words(can::Frame::base(0x705, {5})), "Heartbeat of node 5: operational");
  EXPECT_EQ(words.words(can::Frame::request(0x705, 1)), "Node guarding of node 5");
  EXPECT_EQ(words.words(can::Frame::base(0x605, {0x40, 0x18, 0x10, 4, 0, 0, 0, 0})), "SDO to node 5: read 1018h:04");
  EXPECT_EQ(words.words(can::Frame::base(0x585, {0x80, 0x18, 0x10, 4, 0, 0, 2, 6})),
            "SDO of node 5: abort 1018h:04, 06020000h, object does not exist");
  EXPECT_EQ(words.words(can::Frame::base(0x85, {0x50, 0x81, 0x11, 0, 0, 0, 0, 0})),
            "EMCY of node 5: 8150h CAN-ID collision, register 11h (generic, communication)");
  EXPECT_EQ(words.words(can::Frame::base(0x185, {1})), "TPDO 1 of node 5");
  EXPECT_EQ(words.words(can::Frame::base(0x205, {1})), "RPDO 1 of node 5");
  EXPECT_EQ(words.words(can::Frame::ext(0x1019, {})), "sub: 1, byte: 0, value: 0x19");
}

}  // namespace
}  // namespace berth::study
