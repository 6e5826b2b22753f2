// Bytes from outside as answers to an LSS master with services under way. Whatever comes, every service ends within its
// times, what it says is within what an answer can say, and an honest answer afterwards is taken.
#include "berth/lss/master.hpp"

#include "fuzz/void_port.hpp"

namespace lss_master_target {

using namespace berth;
using namespace std::chrono_literals;

namespace {

// The service that byte `which` stands for.
lss::Exchange service(lss::Master& master, std::uint8_t which) {
  const lss::FastscanRequest request{.id = which, .bit_checked = which, .sub = 1, .next = 2};
  switch (which % 9) {
    case 0: return master.switch_selective({1, 2, 3, which});
    case 1: return master.configure_node_id(NodeId(5));
    case 2: return master.configure_bit_timing(lss::BitRateIndex::kbit_250);
    case 3: return master.store(lss::ServiceOptions{.timeout = 10ms});
    case 4: return master.inquire(which / 8U);
    case 5: return master.inquire_node_id();
    case 6: return master.identify_remote({});
    case 7: return master.fastscan(request);
    default: return master.identify_non_configured();
  }
}

// Any extended or base frame near the identifiers of feedback.
can::Frame feedback(const std::uint8_t* data) {
  const std::span bytes(data + 4, data[4] % 2);
  if (data[0] % 2 == 0) return can::Frame::ext(0x1F8F'0000U + (data[1] % 4U << 16) + data[2], bytes);
  return can::Frame::base(0x6C8U + data[1] % 32U, bytes);
}

// `newest`: its feedback is still in the master's memory.
void check(const Result<lss::Reply>& reply, bool newest) {
  if (!reply) {
    fuzz::require(reply.error().code != Errc::cancelled);
    return;
  }
  fuzz::require(!reply->differ || reply->answers > 1);
  fuzz::require(reply->attempts >= 1);
  fuzz::require(reply->feedback.size() <= lss::Master::most_feedback);
  for (std::size_t i = 0; newest && i < reply->feedback.size(); ++i) {
    fuzz::require(reply->feedback[i].times > 0);
    fuzz::require(i == 0 || reply->feedback[i - 1].feedback < reply->feedback[i].feedback);
  }
}

}  // namespace

// First byte: which services. Then one frame for each group of nine bytes: when it comes, and its data.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 2) return 0;
  rt::Executor executor;
  fuzz::VoidPort port(executor);
  can::Dispatcher dispatcher(executor, port);
  const lss::ServiceOptions quick{.timeout = 10ms, .retries = data[0] % 3U, .full_window = data[0] % 2 == 0};
  lss::Master master(dispatcher, {.service = quick,
                                  .identify = {.timeout = 10ms, .retries = 0, .full_window = true},
                                  .feedback_base = lss::default_feedback_base});
  auto first = service(master, data[0]);
  auto second = service(master, data[1]);
  fuzz::Flag first_done, second_done;
  first_done.set = first.begin(executor, first_done);
  second_done.set = second.begin(executor, second_done);
  executor.advance(executor.now());
  for (std::size_t at = 2; at + 9 <= size; at += 9) {
    executor.advance(executor.now() + std::chrono::milliseconds(data[at] % 16));
    auto frame = can::Frame::base(lss::slave_cob_id, std::span(data + at + 1, 8));
    if (data[at] >= 0xF0) frame.size = data[at] % 9;
    if (data[at] % 32 == 7) frame = feedback(data + at + 1);
    // Half of the answers fit the newest request, so that more than the first check is reached.
    if (data[at] % 32 >= 16) frame.data[0] = port.last.data[0];
    port.hear(frame);
  }
  executor.advance(executor.now() + 1s);
  fuzz::require(first_done.set && second_done.set);
  check(first.await_resume(), false);
  check(second.await_resume(), true);

  auto honest = master.inquire_node_id(lss::ServiceOptions{.timeout = 10ms, .retries = 0});
  fuzz::Flag done;
  done.set = honest.begin(executor, done);
  executor.advance(executor.now() + 1ms);
  port.hear(can::Frame::base(lss::slave_cob_id, {0x5E, 0x07, 0, 0, 0, 0, 0, 0}));
  executor.advance(executor.now() + 20ms);
  fuzz::require(done.set);
  const auto reply = honest.await_resume();
  fuzz::require(reply && reply->byte() == 7);
  return 0;
}

}  // namespace lss_master_target
