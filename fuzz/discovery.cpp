// Forged answers while devices are looked for: LSS, feedback, RAND and AND replies that no honest device gives.
// Whatever comes, the search ends, gives no more devices than asked for, and no node-ID that is none.
//
// Input: the first byte chooses the method, the second what is known; then ten bytes for each answer: when it comes,
// and its data.
#include <algorithm>
#include <memory>

#include "berth/discovery/auto.hpp"
#include "berth/rt/scope.hpp"
#include "fuzz/void_port.hpp"

namespace discovery_target {

using namespace berth;
using namespace std::chrono_literals;

namespace {

constexpr unsigned most_devices = 20;

class Giver final : public discovery::Assigner {
 public:
  NodeId assign(const LssAddress&, bool) noexcept override {
    return NodeId(static_cast<std::uint8_t>(1 + next_++ % 127));
  }

 private:
  unsigned next_ = 0;
};

rt::Task<void> look(discovery::Discovery& method, const discovery::Known& known, const discovery::Options& options,
                    bool& over) {
  const auto report = co_await method.find(known, options);
  over = true;
  if (!report) co_return;
  fuzz::require(report->found.size() <= most_devices + 1);
  for (const auto& device : report->found) fuzz::require(device.assigned.value() != 0);
}

can::Frame answer(const std::uint8_t* data, const can::Frame& last) {
  const std::span bytes(data + 1, 8);
  switch (data[0] % 8) {
    case 0: return can::Frame::ext(0x1F8F'0000U + (data[1] % 8U << 16U) + data[2], std::span(bytes).first(data[3] % 2));
    case 1: return can::Frame::ext(0x7E4U << 18U | (data[1] << 8U) | data[2], {});
    case 2: return can::Frame::base(static_cast<std::uint16_t>(0x6C8U + data[1] % 32U), bytes);
    default: break;
  }
  auto frame = can::Frame::base(0x7E4, bytes);
  // Most fit the newest request, so that more than the first check is reached.
  if (data[0] % 8 >= 5) frame.data[0] = last.data[0];
  if (data[0] % 8 == 6) std::copy_n(last.data.begin(), 5, frame.data.begin());
  if (data[0] % 8 == 7) frame.data[0] = 0x4F;
  return frame;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 2) return 0;
  rt::Executor executor;
  fuzz::VoidPort port(executor);
  can::Dispatcher dispatcher(executor, port);
  lss::Master master(dispatcher, {.feedback_base = lss::default_feedback_base});
  const discovery::Services services{dispatcher, master};
  const bool every = data[0] % (discovery::methods + 1) == discovery::methods;
  const auto wanted = static_cast<discovery::Method>(data[0] % discovery::methods);
  std::unique_ptr<discovery::Discovery> method = discovery::make(wanted, services);
  if (every) method = std::make_unique<discovery::Auto>(services);
  discovery::Known known;
  if (data[1] % 2 == 1) known.kinds.push_back({{1, 2}, 3});
  if (data[1] % 4 == 3) known.expected.push_back({1, 2, 3, 4});
  Giver giver;
  discovery::Options options;
  options.most_devices = most_devices;
  options.most_time = 30s;
  options.confirm = data[1] % 8 >= 4;
  if (data[1] % 16 >= 8) options.assigner = &giver;
  // Some searches are destroyed where they stand.
  const bool dropped = data[1] % 64 >= 48;
  const unsigned last = dropped ? data[1] * 4U : 2000U;
  bool over = false;
  {
    rt::Scope scope(executor);
    scope.spawn(look(*method, known, options, over));
    std::size_t at = 2;
    // The same answers again and again, as a forger would, and then silence.
    for (unsigned turn = 0; turn < last + (dropped ? 0U : 2000U) && !over; ++turn) {
      executor.advance(executor.now() + 1ms);
      if (at + 10 > size || turn >= last) continue;
      if (turn % (1U + data[at] % 4U) == 0) port.hear(answer(data + at, port.last));
      at += 10;
      if (at + 10 > size) at = 2;
    }
    for (unsigned turn = 0; turn < 100'000 && !over && !dropped; ++turn) executor.advance(executor.now() + 10ms);
    fuzz::require(over || dropped);
  }
  executor.advance(executor.now() + 1s);
  return 0;
}

}  // namespace discovery_target
