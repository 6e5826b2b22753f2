// Bytes from outside as SDO answers to a client with transfers under way, segmented or in blocks, from memory or from
// streams. Whatever comes, every transfer ends within its times, and an honest answer afterwards is taken.
#include "berth/co/sdo_client.hpp"
#include "fuzz/void_port.hpp"

namespace sdo_client_target {

namespace {

using namespace berth;
using namespace std::chrono_literals;
using fuzz::Flag;
using fuzz::require;

struct Source final : co::SdoSource {
  od::Answer<std::size_t> read(std::span<std::uint8_t> into) noexcept override {
    require(!into.empty());
    const auto count = std::min(into.size(), left);
    left -= count;
    std::memset(into.data(), 1, count);
    return count;
  }
  bool rewind() noexcept override {
    left = 300;
    return true;
  }
  std::size_t left = 300;
};

struct Sink final : co::SdoSink {
  od::AbortCode write(std::span<const std::uint8_t> bytes) noexcept override {
    require(!bytes.empty());
    return od::AbortCode::none;
  }
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  rt::Executor executor;
  fuzz::VoidPort port(executor);
  can::Dispatcher dispatcher(executor, port);
  co::SdoOptions options;
  options.timeout = 10ms;
  options.longest = 500;
  options.retries = static_cast<unsigned>(size % 3);
  co::SdoClient client(dispatcher, options);
  const NodeId node(5);
  const std::uint8_t payload[40] = {1, 2, 3};
  // Which kinds: by the length, so that the frames keep their places when an input is changed.
  options.mode = size % 16 < 8 ? co::SdoMode::segmented : co::SdoMode::block;
  options.block_size = static_cast<std::uint8_t>(1 + size % 5);
  Source source;
  Sink sink;
  auto up = client.upload(node, 0x1008, 0, options);
  auto down = client.download(node, 0x1008, 0, payload, options);
  auto stream_up = client.upload(node, 0x1008, 0, sink, options);
  auto stream_down = client.download(node, 0x1008, 0, source, options);
  Flag first, second, stream_first, stream_second;
  // From the length as well: which of them the input meets first.
  if (size % 32 < 16) {
    up.begin(executor, first);
    down.begin(executor, second);
  }
  stream_up.begin(executor, stream_first);
  stream_down.begin(executor, stream_second);
  if (size % 32 >= 16) {
    up.begin(executor, first);
    down.begin(executor, second);
  }
  for (std::size_t at = 0; at + 8 <= size; at += 8) {
    executor.advance(executor.now() + 1ms);
    // Half of the inputs name the object, so that more than the first check is reached.
    auto answer = can::Frame::base(0x585, std::span(data + at, 8));
    if (size % 2 == 0 && (data[at] >> 5) >= 2)
      store_le(answer.data.data() + 1, std::uint32_t{answer.data[4]} << 24 | 0x1008U);
    port.hear(answer);
  }
  executor.advance(executor.now() + 1s);
  require(first.set && second.set && stream_first.set && stream_second.set);
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

}  // namespace sdo_client_target
