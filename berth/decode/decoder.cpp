#include "berth/decode/decoder.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "berth/base/bytes.hpp"
#include "berth/co/cob_id.hpp"
#include "berth/co/emcy.hpp"
#include "berth/co/nmt.hpp"
#include "berth/decode/emcy_words.hpp"
#include "berth/decode/known_bus.hpp"
#include "berth/decode/say_parts.hpp"
#include "berth/decode/standard_objects.hpp"
#include "berth/od/abort_code.hpp"
#include "berth/od/cia301.hpp"
#include "berth/od/mapping_text.hpp"
#include "berth/od/notation.hpp"

namespace berth::decode {
namespace {

bool printable(std::span<const std::uint8_t> bytes) noexcept {
  return std::all_of(bytes.begin(), bytes.end(), [](std::uint8_t b) { return b >= ' ' && b < 0x7F; });
}

void put_hex(std::span<const std::uint8_t> bytes, std::size_t most, std::string& out) {
  for (std::size_t i = 0; i < std::min(bytes.size(), most); ++i) say(out, "{}{:02X}", i == 0 ? "" : " ", bytes[i]);
  if (bytes.size() > most) out += " ...";
}

// What the value of a signal means. Empty: nothing is known, or it is no value of its type.
std::string meant(const ValueWords& words, ObjectRef object, od::DataType type, unsigned bits, std::uint64_t raw) {
  std::array<std::uint8_t, 8> bytes{};
  const auto size = od::byte_size(type);
  if (od::bit_length(type) != bits || size == 0 || size > bytes.size()) return {};
  od::store(type, raw, bytes.data());
  return words.words(object, type, std::span(bytes).first(size));
}

// What the value of a transfer means, if the whole value is known.
std::string meant(const ValueWords* words, const SdoRecord& record, od::DataType type,
                  std::span<const std::uint8_t> bytes) {
  const bool whole = !record.sized || record.bytes.size() == record.length;
  return words != nullptr && record.has_object && whole ? words->words(record.object, type, bytes) : std::string();
}

}  // namespace

Decoder::Decoder(Rows& rows, DecodeOptions options) : rows_(&rows), options_(options) {}
Decoder::~Decoder() = default;

KnownBus& Decoder::bus(std::uint16_t number) {
  if (number >= buses_.size()) buses_.resize(number + std::size_t{1});
  if (!buses_[number]) buses_[number] = std::make_unique<KnownBus>();
  return *buses_[number];
}

void Decoder::know(std::uint16_t number, NodeId node, Profile profile) {
  if (node.configured()) bus(number).know(node, std::move(profile));
}

void Decoder::field(Field::Kind kind, std::string_view key, std::string value) {
  if (options_.fields) fields_.push_back({kind, std::string(key), std::move(value)});
}

void Decoder::add_name(std::uint8_t node) {
  if (node == 0 || node > 127 || !bus_->nodes[node] || bus_->nodes[node]->name.empty()) return;
  say(words_, " [{}]", bus_->nodes[node]->name);
}

void Decoder::give(Meaning meaning) {
  const Row row{
      .entry = entry_, .began = entry_->at, .frames = 1, .meaning = meaning, .words = words_, .fields = fields_};
  rows_->row(row);
}

void Decoder::entry(const trace::Entry& entry) {
  entry_ = &entry;
  KnownBus& bus = this->bus(entry.bus);
  bus_ = &bus;
  words_.clear();
  if (options_.fields) fields_.clear();
  const can::Frame& frame = entry.frame;
  if (entry.error) {
    error_words(frame, words_);
    return give({Service::error, 0});
  }
  const Route route = frame.fd ? Route{} : bus.route(frame.key());
  switch (route.kind) {
    case Route::Kind::pdo: return pdo(bus, route.index, frame);
    case Route::Kind::request:
    case Route::Kind::response: return sdo(*bus.channels[route.index], route.kind == Route::Kind::request);
    case Route::Kind::emcy:
    case Route::Kind::sync: {
      // The frame is read as if it had the identifier of the predefined connection set.
      can::Frame moved = frame;
      moved.extended = false;
      moved.id = route.kind == Route::Kind::sync ? co::sync_id : 0x80U + route.node;
      const Meaning meaning = bus.interpreter.words(moved, words_);
      say_by_profile(bus, meaning);
      add_name(route.node);
      return give(meaning);
    }
    case Route::Kind::none: break;
  }
  const Meaning meaning = bus.interpreter.words(frame, words_);
  if (meaning.service == Service::heartbeat) heartbeat(bus);
  if (meaning.service == Service::emcy && options_.fields && frame.size == 8 && !frame.remote) {
    field(Field::Kind::text, "code", fmt::format("{:04X}", load_le<std::uint16_t>(frame.data.data())));
    field(Field::Kind::number, "register", std::to_string(frame.data[2]));
  }
  say_by_profile(bus, meaning);
  add_name(meaning.node);
  give(meaning);
}

// The device's profile decides the meaning of an emergency code, if its 1000h is known.
void Decoder::say_by_profile(const KnownBus& bus, Meaning meaning) {
  const can::Frame& frame = entry_->frame;
  const bool emcy = meaning.service == Service::emcy && frame.size == 8 && !frame.remote;
  if (!emcy || meaning.node >= std::size(bus.nodes) || bus.nodes[meaning.node] == nullptr) return;
  const KnownNode& node = *bus.nodes[meaning.node];
  if (node.values == nullptr) return;
  const auto code = load_le<std::uint16_t>(frame.data.data());
  const auto type = node.values->get_or<std::uint32_t>({0x1000, 0}, 0);
  const std::string_view general = co::emcy_text(code);
  const auto at = words_.find(general);
  if (at != std::string::npos) words_.replace(at, general.size(), emcy_words(code, static_cast<std::uint16_t>(type)));
}

// A frame that answers a remote frame is no heartbeat.
void Decoder::heartbeat(KnownBus& bus) {
  const can::Frame& frame = entry_->frame;
  const std::uint8_t node = frame.id & 0x7FU;
  if (frame.remote) {
    bus.guarded.set(node);
    return;
  }
  // 00h is always a boot-up message: no node answers guarding while it initialises.
  if (!bus.guarded.test(node) || frame.size != 1 || frame.data[0] == 0) return;
  bus.guarded.reset(node);
  const auto state = co::nmt_state(frame.data[0] & 0x7FU);
  if (!state) return;
  words_.clear();
  say(words_, "Node guarding answer of node {}: {}, toggle {}", node, berth::name(*state), frame.data[0] >> 7);
}

void Decoder::pdo(const KnownBus& bus, unsigned index, const can::Frame& frame) {
  const KnownPdo& pdo = bus.pdos[index];
  words_ = pdo.head;
  if (options_.fields) {
    field(Field::Kind::text, "kind", pdo.transmit ? "tpdo" : "rpdo");
    field(Field::Kind::number, "number", std::to_string(pdo.number));
  }
  if (frame.remote) {
    words_ += ": remote request";
  } else if (pdo.is_mpdo) {
    if (frame.size != 8) {
      words_ += ": MPDO, not eight bytes";
    } else {
      const ObjectRef object{load_le<std::uint16_t>(frame.data.data() + 1), frame.data[3]};
      say(words_, ": MPDO {} node {}, {}, {:02X} {:02X} {:02X} {:02X}", (frame.data[0] & 0x80U) != 0 ? "to" : "from",
          frame.data[0] & 0x7FU, od::write_object(object), frame.data[4], frame.data[5], frame.data[6], frame.data[7]);
    }
  } else {
    signals(pdo, frame);
  }
  give({Service::pdo, pdo.node});
}

void Decoder::signals(const KnownPdo& pdo, const can::Frame& frame) {
  std::uint64_t all = 0;
  for (unsigned i = frame.size; i-- > 0;) all = all << 8 | frame.data[i];
  const char* between = ": ";
  for (const Signal& signal : pdo.signals) {
    if (signal.dummy) continue;
    words_ += between;
    if (signal.at + signal.bits > 8U * frame.size) {
      words_ += "too short for ";
      words_.append(signal.label, 0, signal.name_size);
      break;
    }
    const std::uint64_t mask = signal.bits == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << signal.bits) - 1;
    const std::uint64_t raw = all >> signal.at & mask;
    words_ += signal.label;
    between = ", ";
    const std::size_t begin = words_.size();
    const auto put = [&](const auto& digits) { words_.append(digits.data(), digits.size()); };
    if (od::bit_length(signal.type) != signal.bits || od::is_time(signal.type)) {
      say(words_, "{:X}h", raw);
    } else if (od::is_real(signal.type)) {
      say(words_, "{}", od::real_of(signal.type, raw));
    } else if (od::is_signed(signal.type)) {
      put(fmt::format_int(static_cast<std::int64_t>(od::wrap(signal.type, raw))));
    } else {
      put(fmt::format_int(raw));
    }
    if (options_.fields) {
      field(Field::Kind::signal, signal.label.substr(0, signal.name_size), words_.substr(begin));
      fields_.back().object = signal.object;
    }
    if (signal.words == nullptr) continue;
    const std::string means = meant(*signal.words, signal.object, signal.type, signal.bits, raw);
    if (!means.empty()) say(words_, " ({})", means);
  }
  if (frame.size > (pdo.bits + 7) / 8) say(words_, " (and {} bytes more)", frame.size - (pdo.bits + 7) / 8);
}

void Decoder::sdo(Channel& channel, bool request) {
  const can::Frame& frame = entry_->frame;
  if (!options_.fold || frame.size != 8 || frame.remote) return sdo_frame(*bus_, channel, request);
  channel_ = &channel;
  channel.transfer.frame(frame, request, entry_->at, *this);
  if (channel.transfer.busy()) channel.last = *entry_;
}

// One frame of a channel, without its transfer.
void Decoder::sdo_frame(const KnownBus& bus, const Channel& channel, bool request) {
  can::Frame moved = entry_->frame;
  moved.extended = false;
  moved.id = (request ? 0x600U : 0x580U) + channel.node;
  Interpreter plain;
  plain.words(moved, words_);
  const unsigned specifier = moved.data[0] >> 5;
  const KnownNode* const node = bus.nodes[channel.node].get();
  const bool with_object =
      moved.size == 8 && !moved.remote && (specifier == 2 || specifier == 4 || specifier == (request ? 1U : 3U));
  if (with_object) {
    const ObjectRef object{load_le<std::uint16_t>(moved.data.data() + 1), moved.data[3]};
    std::string name =
        node != nullptr && node->values ? object_name(node->values->description(), object) : std::string();
    if (name.empty()) name = standard_object(object).name;
    if (!name.empty()) say(words_, " {}", name);
    if (options_.fields) {
      field(Field::Kind::text, "object", od::write_object(object));
      if (!name.empty()) field(Field::Kind::text, "name", name);
      if (specifier == 4)
        field(Field::Kind::text, "abort", fmt::format("{:08X}", load_le<std::uint32_t>(moved.data.data() + 4)));
    }
  }
  add_name(channel.node);
  give({Service::sdo, channel.node});
}

// A value in words: by its type if the length fits, else as text or bytes.
void Decoder::put_value(od::DataType type, std::span<const std::uint8_t> bytes, bool all) {
  constexpr std::size_t most_text = 80;
  constexpr std::size_t most_bytes = 16;
  const auto length = od::byte_size(type);
  if (type != od::DataType::none && length == bytes.size() && length > 0) {
    value_ += od::print(type, bytes);
    if (od::is_unsigned(type) && length > 1) {
      std::uint64_t raw = od::load(type, bytes.data());
      say(value_, " (0x{:0{}X})", raw, 2 * length);
    }
    return;
  }
  if ((type == od::DataType::visible_string || (bytes.size() > 4 && type == od::DataType::none)) && printable(bytes)) {
    const auto shown = std::min(bytes.size(), most_text);
    say(value_, "\"{}\"", std::string_view(reinterpret_cast<const char*>(bytes.data()), shown));
    if (shown < bytes.size() || !all) value_ += " ...";
    return;
  }
  put_hex(bytes, most_bytes, value_);
}

// Adds the object's words and fields; returns the type of its value.
od::DataType Decoder::say_object(const KnownNode* node, ObjectRef object) {
  od::DataType type = od::DataType::none;
  std::string name;
  if (node != nullptr && node->values) {
    name = object_name(node->values->description(), object);
    const auto* const sub = node->values->description().find(object);
    if (sub != nullptr) type = sub->type;
  }
  if (const NamedObject* const variable = node == nullptr ? nullptr : node->named_of(object)) {
    name = variable->name;
    type = variable->type;
  }
  if (name.empty()) {
    const auto standard = standard_object(object);
    name = standard.name;
    type = standard.type;
  }
  say(words_, " {:04X}h:{:02X}", object.index, object.sub);
  if (!name.empty()) say(words_, " {}", name);
  field(Field::Kind::text, "object", options_.fields ? od::write_object(object) : std::string());
  if (!name.empty()) field(Field::Kind::text, "name", std::move(name));
  return type;
}

void Decoder::say_end(const SdoRecord& record) {
  using End = SdoRecord::End;
  switch (record.end) {
    case End::done:
      if (record.announced && *record.announced != record.length)
        say(words_, " ({} bytes were announced, {} came)", *record.announced, record.length);
      break;
    case End::aborted_by_client:
    case End::aborted_by_server:
      say(words_, ": abort by the {}, {:08X}h, {}", record.end == End::aborted_by_client ? "client" : "server",
          record.abort, od::text(static_cast<od::AbortCode>(record.abort)));
      if (options_.fields) field(Field::Kind::text, "abort", fmt::format("{:08X}", record.abort));
      break;
    case End::unfinished: words_ += record.frames == 1 ? ": no answer" : ": unfinished"; break;
    case End::stray: words_ += ": belongs to no transfer that was seen to begin"; break;
  }
}

void Decoder::ended(const SdoRecord& record) {
  using End = SdoRecord::End;
  const std::uint8_t id = channel_->node;
  words_.clear();
  value_.clear();
  if (options_.fields) fields_.clear();
  // A lone abort may have refused a read or a write.
  const bool nothing_known = record.end == End::stray || (record.frames == 1 && record.abort != 0);
  say(words_, "SDO {} node {}", nothing_known ? "of" : record.write ? "write" : "read", id);
  if (channel_->number > 1) say(words_, " (channel {})", channel_->number);
  const auto type = record.has_object ? say_object(bus_->nodes[id].get(), record.object) : od::DataType::none;
  std::span<const std::uint8_t> bytes(record.bytes);
  if (!record.sized && od::byte_size(type) > 0) bytes = bytes.first(std::min(bytes.size(), od::byte_size(type)));
  const bool has_value = record.end == End::done || (record.write && record.length > 0 && record.end != End::stray);
  if (has_value) {
    put_value(type, bytes, record.bytes.size() == record.length);
    say(words_, " = {}", value_);
  }
  const KnownNode* const node = bus_->nodes[id].get();
  std::string means = has_value && node != nullptr ? meant(node->words.get(), record, type, bytes) : std::string();
  if (has_value && means.empty() && record.has_object) means = od::mapping_text(record.object, bytes);
  if (!means.empty()) say(words_, " = {}", means);
  if (options_.fields && has_value) {
    field(Field::Kind::text, "value", value_);
    if (!means.empty()) field(Field::Kind::text, "meaning", means);
    std::string hex;
    put_hex(bytes, bytes.size(), hex);
    field(Field::Kind::text, "bytes", std::move(hex));
    field(Field::Kind::number, "length", std::to_string(record.sized ? record.length : bytes.size()));
  }
  constexpr const char* modes[]{"expedited", "segmented", "block"};
  constexpr const char* results[]{"done", "aborted by the client", "aborted by the server", "unfinished", "stray"};
  const char* const mode = modes[static_cast<int>(record.mode)];
  if (options_.fields) {
    if (!nothing_known) {
      field(Field::Kind::text, "access", record.write ? "write" : "read");
      field(Field::Kind::text, "mode", mode);
    }
    field(Field::Kind::text, "result", results[static_cast<int>(record.end)]);
  }
  say_end(record);
  if (record.mode != SdoRecord::Mode::expedited)
    say(words_, " ({}, {} bytes, {} frames)", mode, record.length, record.frames);
  add_name(id);
  // A transfer that did not end is reported later, when another begins: the row shows its own last frame.
  const Row row{.entry = record.end == End::unfinished ? &channel_->last : entry_,
                .began = record.began,
                .frames = record.frames,
                .meaning = {Service::sdo, id},
                .words = words_,
                .fields = fields_};
  rows_->row(row);
  if (record.end == End::done && record.bytes.size() == record.length) bus_->learn(id, record.object, bytes);
}

void Decoder::finish() {
  for (const auto& bus : buses_) {
    if (!bus) continue;
    bus_ = bus.get();
    for (const auto& channel : bus->channels) {
      if (!channel->transfer.busy()) continue;
      channel_ = channel.get();
      channel->transfer.finish(*this);
    }
  }
}

std::optional<rt::Duration> Decoder::pending() const noexcept {
  std::optional<rt::Duration> earliest;
  for (const auto& bus : buses_) {
    if (!bus) continue;
    for (const auto& channel : bus->channels) {
      if (channel->transfer.busy() && (!earliest || channel->last.at < *earliest)) earliest = channel->last.at;
    }
  }
  return earliest;
}

}  // namespace berth::decode
