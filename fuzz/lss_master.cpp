// Bytes from outside as answers to an LSS master with services under way. Whatever comes, every service ends within its
// times, what it says is within what an answer can say, and an honest answer afterwards is taken.
#include "berth/lss/master.hpp"

#include "fuzz/void_port.hpp"

using namespace berth;
using namespace std::chrono_literals;

namespace {

// The service that byte `which` stands for.
lss::Exchange service(lss::Master& master, std::uint8_t which) {
  switch (which % 8) {
    case 0: return master.switch_selective({1, 2, 3, which});
    case 1: return master.configure_node_id(NodeId(5));
    case 2: return master.configure_bit_timing(lss::BitRateIndex::kbit_250);
    case 3: return master.store({.timeout = 10ms});
    case 4: return master.inquire(which / 8U);
    case 5: return master.inquire_node_id();
    case 6: return master.identify_remote({});
    default: return master.identify_non_configured();
  }
}

void check(const Result<lss::Reply>& reply) {
  if (!reply) {
    fuzz::require(reply.error().code != Errc::cancelled);
    return;
  }
  fuzz::require(!reply->differ || reply->answers > 1);
  fuzz::require(reply->attempts >= 1);
}

}  // namespace

// First byte: which services. Then one frame for each group of nine bytes: when it comes, and its data.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 2) return 0;
  rt::Executor executor;
  fuzz::VoidPort port(executor);
  can::Dispatcher dispatcher(executor, port);
  const lss::ServiceOptions quick{.timeout = 10ms, .retries = data[0] % 3U, .full_window = data[0] % 2 == 0};
  lss::Master master(dispatcher, {.service = quick, .identify = {.timeout = 10ms, .retries = 0, .full_window = true}});
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
    // Half of the answers fit the newest request, so that more than the first check is reached.
    if (data[at] % 32 >= 16) frame.data[0] = port.last.data[0];
    port.hear(frame);
  }
  executor.advance(executor.now() + 1s);
  fuzz::require(first_done.set && second_done.set);
  check(first.await_resume());
  check(second.await_resume());

  auto honest = master.inquire_node_id({.timeout = 10ms, .retries = 0});
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
