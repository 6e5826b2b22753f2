// CiA 305's table of services and LSS states (§6.3 to §6.7; docs/protocols/cia305.md §State table), cell by cell: a
// slave, with and without a node-ID, in each state, gets the whole of each service. Expected bytes are written by hand
// (docs/protocols/cia305.md §Frames).
#include <gtest/gtest.h>
#include <chrono>
#include <optional>

#include <string>
#include <vector>

#include "berth/lss/slave.hpp"

namespace berth::lss::slave_state_tests {
namespace {

constexpr LssAddress address{0x0100'0001, 0x0000'0001, 0x0002'0003, 0xDEAD'BEEF};

struct Owner final : SlaveOwner {
  std::optional<StoreResult> store(const Settings&) noexcept override {
    ++stores;
    return StoreResult{};
  }
  void wants_reset_communication() noexcept override {}
  void switch_bit_rate(BitRateIndex) noexcept override {}
  void silence_over() noexcept override {}
  unsigned stores = 0;
};

/// What a cell of the table says: the answer to the service's last frame ("" for none), and the state after it.
struct Cell {
  std::string answer;
  State after;
};
struct Row {
  std::string service;
  std::vector<std::string> frames;
  Cell blank_waiting, blank_configuration, configured_waiting, configured_configuration;
};

constexpr State W = State::waiting;
constexpr State C = State::configuration;
const Cell silent_W{"", W};
const Cell silent_C{"", C};
Cell said_W(const std::string& bytes) { return {"7E4#" + bytes, W}; }
Cell said_C(const std::string& bytes) { return {"7E4#" + bytes, C}; }
// Served in configuration only.
Row configuration_only(const std::string& service, const std::string& frame, const std::string& bytes) {
  return {service, {frame}, silent_W, said_C(bytes), silent_W, said_C(bytes)};
}

const std::vector<Row>& table() {
  static const std::vector<Row> rows{
      // §6.3 switch state: global in both states, selective in waiting only.
      {"switch global, configuration", {"0401000000000000"}, silent_C, silent_C, silent_C, silent_C},
      {"switch global, waiting", {"0400000000000000"}, silent_W, silent_W, silent_W, silent_W},
      {"switch selective, its address",
       {"4001000001000000", "4101000000000000", "4203000200000000", "43EFBEADDE000000"},
       said_C("4400000000000000"),
       silent_C,
       said_C("4400000000000000"),
       silent_C},
      {"switch selective, another's",
       {"4001000001000000", "4101000000000000", "4203000200000000", "43F0BEADDE000000"},
       silent_W,
       silent_C,
       silent_W,
       silent_C},
      // §6.4 configuration.
      configuration_only("configure node-ID", "1107000000000000", "1100000000000000"),
      configuration_only("configure bit timing", "1300020000000000", "1300000000000000"),
      {"activate bit timing", {"15E8030000000000"}, silent_W, silent_C, silent_W, silent_C},
      configuration_only("store", "1700000000000000", "1700000000000000"),
      // §6.5 inquiry.
      configuration_only("inquire vendor-ID", "5A00000000000000", "5A01000001000000"),
      configuration_only("inquire product code", "5B00000000000000", "5B01000000000000"),
      configuration_only("inquire revision number", "5C00000000000000", "5C03000200000000"),
      configuration_only("inquire serial number", "5D00000000000000", "5DEFBEADDE000000"),
      {"inquire node-ID",
       {"5E00000000000000"},
       silent_W,
       said_C("5EFF000000000000"),
       silent_W,
       said_C("5E05000000000000")},
      // §6.6 identification, in both states; non-configured only without a node-ID.
      {"identify remote slave",
       {"4601000001000000", "4701000000000000", "4800000000000000", "49FFFFFFFF000000", "4A00000000000000",
        "4BFFFFFFFF000000"},
       said_W("4F00000000000000"),
       said_C("4F00000000000000"),
       said_W("4F00000000000000"),
       said_C("4F00000000000000")},
      {"identify non-configured",
       {"4C00000000000000"},
       said_W("5000000000000000"),
       said_C("5000000000000000"),
       silent_W,
       silent_C},
      // §6.7 Fastscan, in waiting and without a node-ID only.
      {"Fastscan, new scan", {"5100000000800000"}, said_W("4F00000000000000"), silent_C, silent_W, silent_C},
      {"Fastscan, to its end",
       {"5100000000800000", "5101000001000001", "5101000000000102", "5103000200000203", "51EFBEADDE000300"},
       said_C("4F00000000000000"),
       silent_C,
       silent_W,
       silent_C},
  };
  return rows;
}

void expect_cell(const Row& row, bool configured, State state, const Cell& cell) {
  SCOPED_TRACE(row.service + (configured ? ", with a node-ID" : ", without a node-ID") +
               (state == C ? ", in configuration" : ", waiting"));
  rt::Executor executor;
  Owner owner;
  const NodeId own = configured ? NodeId(5) : NodeId();
  Slave slave(executor, owner, {.address = address}, {.node_id = own});
  slave.reset_communication();
  if (state == C) slave.handle(*can::parse_frame("7E5#0401000000000000"));
  ASSERT_EQ(slave.state(), state);
  const Settings before = slave.pending();
  std::string last;
  for (std::size_t i = 0; i < row.frames.size(); ++i) {
    const auto answer = slave.handle(*can::parse_frame("7E5#" + row.frames[i]));
    last = answer ? can::to_string(*answer) : "";
  }
  EXPECT_EQ(last, cell.answer);
  EXPECT_EQ(slave.state(), cell.after);
  if (state == W) {
    EXPECT_EQ(slave.pending(), before) << "waiting, and it executed something";
    EXPECT_EQ(owner.stores, 0U);
  }
}

TEST(LssSlaveStates, HC3_4_EveryServiceInEveryState) {
  for (const Row& row : table()) {
    expect_cell(row, false, W, row.blank_waiting);
    expect_cell(row, false, C, row.blank_configuration);
    expect_cell(row, true, W, row.configured_waiting);
    expect_cell(row, true, C, row.configured_configuration);
  }
}

// Activate bit timing has no answer: that waiting ignores it is seen by what follows, silence for the second delay.
TEST(LssSlaveStates, ActivateBitTimingIsIgnoredInWaiting) {
  for (const State state : {W, C}) {
    rt::Executor executor;
    Owner owner;
    Slave slave(executor, owner, {.address = address}, {});
    slave.reset_communication();
    if (state == C) slave.handle(*can::parse_frame("7E5#0401000000000000"));
    slave.handle(*can::parse_frame("7E5#150A000000000000"));
    executor.advance(executor.now() + std::chrono::milliseconds(15));
    EXPECT_EQ(slave.silent(), state == C);
  }
}

// A sequence of 40h to 43h that is begun in waiting does not go on in configuration, nor the other way round.
TEST(LssSlaveStates, ASequenceDoesNotOutliveItsState) {
  rt::Executor executor;
  Owner owner;
  Slave slave(executor, owner, {.address = address}, {});
  slave.reset_communication();
  const auto tell = [&](const char* bytes) { return slave.handle(*can::parse_frame(std::string("7E5#") + bytes)); };
  tell("0401000000000000");
  for (const char* frame : {"4001000001000000", "4101000000000000", "4203000200000000"}) EXPECT_FALSE(tell(frame));
  tell("0400000000000000");
  EXPECT_FALSE(tell("43EFBEADDE000000"));
  EXPECT_EQ(slave.state(), W);
}

}  // namespace
}  // namespace berth::lss::slave_state_tests
