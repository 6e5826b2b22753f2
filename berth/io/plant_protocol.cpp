#include "berth/io/plant_protocol.hpp"

#include <algorithm>

namespace berth::io {
namespace {

enum FrameFlag : std::uint8_t { remote_frame = 1 };
enum StatusFlag : std::uint8_t {
  listen_only = 1,
  bus_off = 2,
  up = 4,
  knows_counters = 8,
  knows_sent = 16,
  knows_errors = 32,
};

class MessageWriter {
 public:
  explicit MessageWriter(MessageKind kind) { u8(static_cast<std::uint8_t>(kind)); }
  void u8(std::uint8_t v) { bytes_.push_back(v); }
  void u16(std::uint16_t v) {
    u8(static_cast<std::uint8_t>(v & 0xFFU));
    u8(static_cast<std::uint8_t>(v >> 8U));
  }
  void u32(std::uint32_t v) {
    u16(static_cast<std::uint16_t>(v & 0xFFFFU));
    u16(static_cast<std::uint16_t>(v >> 16U));
  }
  void text(const std::string& t) {
    const auto size = static_cast<std::ptrdiff_t>(std::min(t.size(), most_text));
    bytes_.insert(bytes_.end(), t.begin(), t.begin() + size);
  }
  void frame(const can::Frame& f) {
    u32(f.key());
    u8(f.remote ? remote_frame : 0);
    u8(std::min<std::uint8_t>(f.size, 8));
    const auto data = f.bytes().first(std::min<std::size_t>(f.bytes().size(), 8));
    bytes_.insert(bytes_.end(), data.begin(), data.end());
  }
  void status(const can::Status& s) {
    u32(s.bit_rate);
    u16(s.tec);
    u16(s.rec);
    u32(s.errors);
    u8(static_cast<std::uint8_t>((s.listen_only ? listen_only : 0) | (s.bus_off ? bus_off : 0) | (s.up ? up : 0) |
                                 (s.knows_counters ? knows_counters : 0) | (s.knows_sent ? knows_sent : 0) |
                                 (s.knows_errors ? knows_errors : 0)));
  }
  std::vector<std::uint8_t> take() { return std::move(bytes_); }

 private:
  std::vector<std::uint8_t> bytes_;
};

class Reader {
 public:
  explicit Reader(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}
  [[nodiscard]] bool whole() const noexcept { return good_ && bytes_.empty(); }
  [[nodiscard]] std::size_t left() const noexcept { return bytes_.size(); }
  void fail() noexcept { good_ = false; }
  std::uint8_t u8() noexcept {
    if (bytes_.empty()) {
      good_ = false;
      return 0;
    }
    const auto v = bytes_.front();
    bytes_ = bytes_.subspan(1);
    return v;
  }
  std::uint16_t u16() noexcept {
    const unsigned low = u8();
    return static_cast<std::uint16_t>(low | static_cast<unsigned>(u8()) << 8U);
  }
  std::uint32_t u32() noexcept {
    const std::uint32_t low = u16();
    return low | static_cast<std::uint32_t>(u16()) << 16U;
  }
  std::string text() {
    if (bytes_.size() > most_text) good_ = false;
    std::string t(bytes_.begin(), bytes_.end());
    bytes_ = {};
    return t;
  }
  can::Frame frame() noexcept {
    can::Frame f;
    const auto key = u32();
    const auto flags = u8();
    f.extended = (key & can::extended_flag) != 0;
    f.id = key & ~can::extended_flag;
    f.remote = (flags & remote_frame) != 0;
    f.size = u8();
    if (f.id > (f.extended ? can::extended_mask : can::base_mask) || flags > remote_frame || f.size > 8) good_ = false;
    if (!good_) return {};
    for (std::size_t i = 0; !f.remote && i < f.size; ++i) f.data[i] = u8();
    return f;
  }
  can::Status status() noexcept {
    can::Status s;
    s.bit_rate = u32();
    s.tec = u16();
    s.rec = u16();
    s.errors = u32();
    const auto flags = u8();
    s.listen_only = (flags & listen_only) != 0;
    s.bus_off = (flags & bus_off) != 0;
    s.up = (flags & up) != 0;
    s.knows_counters = (flags & knows_counters) != 0;
    s.knows_sent = (flags & knows_sent) != 0;
    s.knows_errors = (flags & knows_errors) != 0;
    return s;
  }

 private:
  std::span<const std::uint8_t> bytes_;
  bool good_ = true;
};

void read_ranges(Reader& in, Message& m) {
  if (in.left() > most_ranges * 8) return in.fail();
  while (in.left() >= 8) {
    const auto first = in.u32();
    m.ranges.push_back({first, in.u32()});
  }
}

}  // namespace

std::vector<std::uint8_t> encode(const Message& m) {
  MessageWriter out(m.kind);
  switch (m.kind) {
    case MessageKind::hello:
      out.u8(plant_protocol_version);
      out.text(m.text);
      break;
    case MessageKind::refused: out.text(m.text); break;
    case MessageKind::send:
      out.u32(m.tag);
      out.frame(m.frame);
      break;
    case MessageKind::withdraw:
    case MessageKind::sent: out.u32(m.tag); break;
    case MessageKind::not_sent:
      out.u32(m.tag);
      out.u8(static_cast<std::uint8_t>(m.reason));
      break;
    case MessageKind::listen:
      for (std::size_t i = 0; i < std::min(m.ranges.size(), most_ranges); ++i) {
        out.u32(m.ranges[i].first);
        out.u32(m.ranges[i].last);
      }
      break;
    case MessageKind::restart: out.u32(m.number); break;
    case MessageKind::received: out.frame(m.frame); break;
    case MessageKind::welcome:
    case MessageKind::changed: out.status(m.status); break;
  }
  return out.take();
}

std::optional<Message> decode(std::span<const std::uint8_t> packet) {
  Reader in(packet);
  Message m;
  m.kind = static_cast<MessageKind>(in.u8());
  switch (m.kind) {
    case MessageKind::hello:
      if (in.u8() != plant_protocol_version) in.fail();
      m.text = in.text();
      break;
    case MessageKind::refused: m.text = in.text(); break;
    case MessageKind::send:
      m.tag = in.u32();
      m.frame = in.frame();
      break;
    case MessageKind::withdraw:
    case MessageKind::sent: m.tag = in.u32(); break;
    case MessageKind::not_sent: {
      m.tag = in.u32();
      const auto reason = in.u8();
      if (reason > static_cast<std::uint8_t>(can::Queued::closed))
        in.fail();
      else
        m.reason = static_cast<can::Queued>(reason);
      break;
    }
    case MessageKind::listen: read_ranges(in, m); break;
    case MessageKind::restart: m.number = in.u32(); break;
    case MessageKind::received: m.frame = in.frame(); break;
    case MessageKind::welcome:
    case MessageKind::changed: m.status = in.status(); break;
    default: return std::nullopt;
  }
  if (!in.whole()) return std::nullopt;
  return m;
}

}  // namespace berth::io
