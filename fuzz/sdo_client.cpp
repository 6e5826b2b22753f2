// Bytes from outside as SDO answers to a client with transfers under way. Whatever comes, every transfer ends within
// its times, and an honest answer afterwards is taken.
#include "berth/co/sdo_client.hpp"

#include <cstdlib>

namespace {

using namespace berth;
using namespace std::chrono_literals;

void require(bool condition) {
  if (!condition) std::abort();
}

// Sends at once into the void and confirms.
class Port final : public can::Port, private rt::Job {
 public:
  explicit Port(rt::Executor& executor) : executor_(executor) {}
  can::Queued send(const can::Frame& frame, std::uint32_t tag) noexcept override {
    last = frame;
    if (tag == 0) return can::Queued::yes;
    tags_.push_back(tag);
    executor_.post(*this);
    return can::Queued::yes;
  }
  void withdraw(std::uint32_t tag) noexcept override { std::erase(tags_, tag); }
  void listen(can::Listener* listener, std::span<const can::IdRange>) noexcept override { listener_ = listener; }
  can::Status status() const noexcept override { return {}; }
  bool restart(std::uint32_t) noexcept override { return true; }
  void hear(const can::Frame& frame) noexcept {
    if (listener_ != nullptr) listener_->received(frame, executor_.now());
  }
  can::Frame last;

 private:
  void run() noexcept override {
    while (!tags_.empty()) {
      const auto tag = tags_.front();
      tags_.erase(tags_.begin());
      if (listener_ != nullptr) listener_->sent(tag, executor_.now());
    }
  }
  rt::Executor& executor_;
  can::Listener* listener_ = nullptr;
  std::vector<std::uint32_t> tags_;
};

struct Flag final : rt::Job {
  void run() noexcept override { set = true; }
  bool set = false;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  rt::Executor executor;
  Port port(executor);
  can::Dispatcher dispatcher(executor, port);
  co::SdoOptions options;
  options.timeout = 10ms;
  options.longest = 500;
  options.retries = static_cast<unsigned>(size % 3);
  co::SdoClient client(dispatcher, options);
  const NodeId node(5);
  const std::uint8_t payload[40] = {1, 2, 3};
  auto up = client.upload(node, 0x1008, 0);
  auto down = client.download(node, 0x1008, 0, payload);
  Flag first, second;
  up.begin(executor, first);
  down.begin(executor, second);
  for (std::size_t at = 0; at + 8 <= size; at += 8) {
    executor.advance(executor.now() + 1ms);
    // Half of the inputs name the object, so that more than the first check is reached.
    auto answer = can::Frame::base(0x585, std::span(data + at, 8));
    if (size % 2 == 0 && (data[at] >> 5) >= 2)
      store_le(answer.data.data() + 1, std::uint32_t{answer.data[4]} << 24 | 0x1008U);
    port.hear(answer);
  }
  executor.advance(executor.now() + 1s);
  require(first.set && second.set);
  auto honest = client.read<std::uint16_t>(node, 0x2000, 0);
  Flag third;
  honest.begin(executor, third);
  executor.advance(executor.now() + 1ms);
  port.hear(can::Frame::base(0x585, {0x4B, 0x00, 0x20, 0, 0x34, 0x12, 0, 0}));
  executor.advance(executor.now() + 1ms);
  require(third.set);
  const auto value = honest.await_resume();
  require(value && *value == 0x1234);
  return 0;
}
