// Any text as the script of a device: it compiles or names its place, and running it ends within its limits.
#include <chrono>
#include <cstdlib>
#include <string>

#include "berth/device/dictionary.hpp"
#include "berth/script/behaviour.hpp"
#include "fuzz/void_port.hpp"

namespace script_target {

namespace {

using namespace berth;

struct Nobody final : script::Behaviour::Listener {
  void script_told(const script::Message& told) noexcept override { (void)script::to_string(told); }
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const script::Script text{"fuzz.lua", std::string(reinterpret_cast<const char*>(data), size)};
  const auto wrong = script::check(text);
  if (wrong && wrong->message.empty()) std::abort();
  rt::Executor executor;
  fuzz::VoidPort port(executor);
  can::Dispatcher dispatcher(executor, port);
  device::Device device(dispatcher, device::minimal_description(), nullptr,
                        {.source = device::NodeIdSource::fixed, .node_id = NodeId(5)});
  Nobody nobody;
  script::Limits limits;
  limits.instructions = 10'000;
  script::Behaviour behaviour(device, executor, text, Random(1), nobody, limits);
  device.power_on();
  executor.advance(executor.now() + std::chrono::milliseconds(5));
  if (wrong && behaviour.running()) std::abort();
  if (behaviour.memory() > limits.memory) std::abort();
  return 0;
}

}  // namespace script_target
