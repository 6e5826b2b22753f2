// Any bytes as a payload of Sparkplug B, as a STATE message and as a topic. What is read as a payload is within the
// limits, and what is written of it is read as the same.
#include <cstdint>
#include <string_view>

#include "berth/sparkplug/codec.hpp"
#include "berth/sparkplug/conform.hpp"
#include "berth/sparkplug/state.hpp"
#include "berth/sparkplug/topic.hpp"
#include "fuzz/require.hpp"

namespace sparkplug_target {

namespace {

using namespace berth;
using namespace berth::sparkplug;
using fuzz::require;

bool unsupported(const Value& value) {
  if (std::holds_alternative<Unsupported>(value)) return true;
  if (const auto* set = std::get_if<Boxed<DataSet>>(&value)) {
    for (const auto& row : (*set)->rows) {
      for (const auto& cell : row) {
        // An empty cell is written as one; so is what does not fit.
        if (unsupported(cell)) return true;
      }
    }
  }
  if (const auto* structure = std::get_if<Boxed<Template>>(&value)) {
    for (const auto& each : (*structure)->parameters) {
      if (unsupported(each.value)) return true;
    }
  }
  return false;
}

/// Every plain metric comes back as it was, except that what is unsupported is written as null.
void again(const Payload& payload) {
  const auto back = decode(encode(payload), {.bytes = 64U << 20, .items = 1U << 20, .depth = 64});
  require(back.has_value() && back->metrics.size() == payload.metrics.size());
  require(back->at == payload.at && back->seq == payload.seq);
  for (std::size_t i = 0; i < payload.metrics.size(); ++i) {
    const auto& was = payload.metrics[i];
    const auto& is = back->metrics[i];
    require(was.name == is.name && was.alias == is.alias && was.at == is.at && was.type == is.type);
    require(was.historical == is.historical && was.transient == is.transient);
    if (unsupported(was.value) || std::holds_alternative<Boxed<Template>>(was.value)) continue;
    require(same(was.value, is.value) || std::holds_alternative<Boxed<DataSet>>(was.value));
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::span bytes(data, size);
  const DecodeLimits limits{.bytes = 4096, .items = 100, .depth = 8};
  if (const auto payload = decode(bytes, limits)) {
    require(payload->metrics.size() <= limits.items);
    for (const auto& each : payload->metrics) {
      const bool nothing = std::holds_alternative<Null>(each.value) || std::holds_alternative<Unsupported>(each.value);
      require(!each.type || nothing || fits(*each.type, each.value));
      (void)quality(each);
      if (each.properties) (void)check(*each.properties);
      (void)check(each.type.value_or(DataType::unknown), each.value, {}, Members::some);
      (void)heap_of(each.value);
    }
    again(*payload);
  } else {
    require(*payload.error().text != '\0');
  }
  if (const auto state = decode_state(bytes)) require(decode_state(encode_state(*state)) == state);
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  if (const auto topic = parse_topic(text)) {
    const auto made = topic->type == MessageType::state ? state_topic(topic->host)
                      : of_device(topic->type)          ? make_topic(topic->edge, topic->type, topic->device)
                                                        : make_topic(topic->edge, topic->type);
    require(made == text);
  }
  return 0;
}

}  // namespace sparkplug_target
