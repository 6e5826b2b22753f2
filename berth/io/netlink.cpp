#include "berth/io/netlink.hpp"

#include <linux/can/netlink.h>
#include <linux/if.h>
#include <linux/if_arp.h>
#include <linux/if_link.h>
#include <linux/netlink.h>
#include <linux/rtnetlink.h>

#include <algorithm>
#include <array>
#include <cstring>

namespace berth::io {
namespace {

constexpr std::size_t up_to_4(std::size_t n) noexcept { return (n + 3U) & ~std::size_t{3}; }

using Bytes = std::span<const std::uint8_t>;

template <class T>
std::optional<T> read(Bytes from) noexcept {
  if (from.size() < sizeof(T)) return std::nullopt;
  T value;
  std::memcpy(&value, from.data(), sizeof value);
  return value;
}

struct Attribute {
  unsigned type = 0;
  Bytes value;
};

// The attributes inside another one; ends at the first that does not fit.
class Attributes {
 public:
  explicit Attributes(Bytes bytes) noexcept : rest_(bytes) {}
  std::optional<Attribute> next() noexcept {
    const auto head = read<nlattr>(rest_);
    if (!head || head->nla_len < sizeof *head || head->nla_len > rest_.size()) return std::nullopt;
    const Attribute a{head->nla_type & static_cast<unsigned>(NLA_TYPE_MASK),
                      rest_.subspan(sizeof *head, head->nla_len - sizeof *head)};
    rest_ = rest_.subspan(std::min(up_to_4(head->nla_len), rest_.size()));
    return a;
  }

 private:
  Bytes rest_;
};

// The text up to the NUL, if there is one.
std::string text_of(Bytes bytes) { return {bytes.begin(), std::ranges::find(bytes, std::uint8_t{0})}; }

void read_controller(Bytes data, Link& link) {
  Attributes attributes(data);
  while (const auto a = attributes.next()) {
    const std::uint32_t number = read<std::uint32_t>(a->value).value_or(0);
    switch (a->type) {
      case IFLA_CAN_BITTIMING:  // the struct begins with it; slcan adapters without a bit rate report "unknown"
        link.bit_rate = number == 0xFFFF'FFFFU ? 0 : number;
        break;
      case IFLA_CAN_DATA_BITTIMING: link.data_bit_rate = number; break;
      case IFLA_CAN_STATE:
        if (number <= static_cast<unsigned>(CanState::sleeping)) link.state = static_cast<CanState>(number);
        break;
      case IFLA_CAN_CTRLMODE:
        if (const auto mode = read<can_ctrlmode>(a->value)) {
          link.listen_only = (mode->flags & CAN_CTRLMODE_LISTENONLY) != 0;
          link.reports_errors = (mode->flags & CAN_CTRLMODE_BERR_REPORTING) != 0;
        }
        break;
      case IFLA_CAN_RESTART_MS: link.restart_ms = number; break;
      case IFLA_CAN_BERR_COUNTER:
        if (const auto counter = read<can_berr_counter>(a->value)) {
          link.counts = true;
          link.tec = counter->txerr;
          link.rec = counter->rxerr;
        }
        break;
      default: break;
    }
  }
}

// The kind may come after the data, but it is needed to read them.
void read_info(Bytes info, Link& link) {
  Bytes data;
  Attributes attributes(info);
  while (const auto a = attributes.next()) {
    if (a->type == IFLA_INFO_KIND) link.kind = text_of(a->value);
    if (a->type == IFLA_INFO_DATA) data = a->value;
  }
  if (link.controller()) read_controller(data, link);
}

std::optional<Link> link_of(Bytes body) {
  const auto head = read<ifinfomsg>(body);
  if (!head) return std::nullopt;
  Link link;
  link.index = head->ifi_index;
  link.can = head->ifi_type == ARPHRD_CAN;
  link.up = (head->ifi_flags & IFF_UP) != 0;
  link.running = (head->ifi_flags & IFF_RUNNING) != 0;
  link.echo = (head->ifi_flags & IFF_ECHO) != 0;
  Attributes attributes(body.subspan(std::min(up_to_4(sizeof *head), body.size())));
  while (const auto a = attributes.next()) {
    switch (a->type) {
      case IFLA_IFNAME: link.name = text_of(a->value); break;
      case IFLA_MTU: link.mtu = read<std::uint32_t>(a->value).value_or(0); break;
      case IFLA_TXQLEN: link.queue = read<std::uint32_t>(a->value).value_or(0); break;
      case IFLA_LINKINFO: read_info(a->value, link); break;
      default: break;
    }
  }
  return link;
}

// Reads the code, the request that it is about (only its header when capped), and the kernel's text.
bool read_reply(Bytes body, unsigned flags, LinkNotice& notice) {
  const auto code = read<std::int32_t>(body);
  if (!code || body.size() < sizeof(nlmsgerr) || *code > 0 || *code < -4095) return false;
  notice.error = -*code;
  const auto about = read<nlmsghdr>(body.subspan(sizeof *code));
  if ((flags & NLM_F_ACK_TLVS) == 0) return true;
  std::size_t length = sizeof(nlmsgerr);
  if ((flags & NLM_F_CAPPED) == 0) length = sizeof *code + std::max<std::size_t>(about->nlmsg_len, sizeof *about);
  Attributes attributes(body.subspan(std::min(up_to_4(length), body.size())));
  while (const auto a = attributes.next()) {
    if (a->type == NLMSGERR_ATTR_MSG) notice.text = text_of(a->value);
  }
  return true;
}

std::optional<LinkNotice> read_notice(const nlmsghdr& head, Bytes body) {
  LinkNotice notice;
  notice.sequence = head.nlmsg_seq;
  switch (head.nlmsg_type) {
    case RTM_NEWLINK:
    case RTM_DELLINK: {
      auto link = link_of(body);
      if (!link) return std::nullopt;
      notice.kind = head.nlmsg_type == RTM_NEWLINK ? LinkNotice::Kind::link : LinkNotice::Kind::gone;
      notice.link = std::move(*link);
      return notice;
    }
    case NLMSG_ERROR:
      notice.kind = LinkNotice::Kind::reply;
      if (!read_reply(body, head.nlmsg_flags, notice)) return std::nullopt;
      return notice;
    default: return notice;
  }
}

class RequestWriter {
 public:
  RequestWriter(unsigned type, unsigned flags, std::uint32_t sequence, int index, unsigned set, unsigned change) {
    nlmsghdr head{};
    head.nlmsg_type = static_cast<std::uint16_t>(type);
    head.nlmsg_flags = static_cast<std::uint16_t>(flags | NLM_F_REQUEST);
    head.nlmsg_seq = sequence;
    put(head);
    ifinfomsg info{};
    info.ifi_family = AF_UNSPEC;
    info.ifi_index = index;
    info.ifi_flags = set;
    info.ifi_change = change;
    put(info);
  }
  template <class T>
  void attribute(unsigned type, const T& value) {
    std::array<std::uint8_t, sizeof value> bytes;
    std::memcpy(bytes.data(), &value, sizeof value);
    attribute(type, Bytes(bytes));
  }
  void attribute(unsigned type, Bytes value) {
    const auto at = begin(type);
    bytes_.insert(bytes_.end(), value.begin(), value.end());
    end(at);
  }
  void attribute(unsigned type, std::string_view value) {
    std::vector<std::uint8_t> text(value.begin(), value.end());
    text.push_back(0);
    attribute(type, Bytes(text));
  }
  std::size_t begin(unsigned type) {
    nlattr head{};
    head.nla_type = static_cast<std::uint16_t>(type);
    const auto at = bytes_.size();
    put(head);
    return at;
  }
  void end(std::size_t at) {
    const auto length = static_cast<std::uint16_t>(bytes_.size() - at);
    std::memcpy(bytes_.data() + at + offsetof(nlattr, nla_len), &length, sizeof length);
    bytes_.resize(up_to_4(bytes_.size()), 0);
  }
  std::vector<std::uint8_t> take() {
    const auto length = static_cast<std::uint32_t>(bytes_.size());
    std::memcpy(bytes_.data() + offsetof(nlmsghdr, nlmsg_len), &length, sizeof length);
    return std::move(bytes_);
  }

 private:
  template <class T>
  void put(const T& value) {
    const auto at = bytes_.size();
    bytes_.resize(at + up_to_4(sizeof value), 0);
    std::memcpy(bytes_.data() + at, &value, sizeof value);
  }
  std::vector<std::uint8_t> bytes_;
};

void write_controller(RequestWriter& out, const LinkChange& change) {
  const auto info = out.begin(IFLA_LINKINFO | NLA_F_NESTED);
  out.attribute(IFLA_INFO_KIND, std::string_view("can"));
  const auto data = out.begin(IFLA_INFO_DATA | NLA_F_NESTED);
  if (change.bit_rate) {
    can_bittiming timing{};
    timing.bitrate = *change.bit_rate;
    out.attribute(IFLA_CAN_BITTIMING, timing);
  }
  if (change.listen_only) {
    can_ctrlmode mode{};
    mode.mask = CAN_CTRLMODE_LISTENONLY;
    mode.flags = *change.listen_only ? CAN_CTRLMODE_LISTENONLY : 0;
    out.attribute(IFLA_CAN_CTRLMODE, mode);
  }
  if (change.restart) out.attribute(IFLA_CAN_RESTART, std::uint32_t{1});
  out.end(data);
  out.end(info);
}

}  // namespace

std::string_view to_string(CanState state) noexcept {
  switch (state) {
    case CanState::active: return "error active";
    case CanState::warning: return "error warning";
    case CanState::passive: return "error passive";
    case CanState::bus_off: return "bus-off";
    case CanState::stopped: return "stopped";
    case CanState::sleeping: return "sleeping";
  }
  return "?";
}

std::vector<LinkNotice> decode_links(std::span<const std::uint8_t> packet) {
  std::vector<LinkNotice> notices;
  while (const auto head = read<nlmsghdr>(packet)) {
    if (head->nlmsg_len < sizeof *head || head->nlmsg_len > packet.size()) break;
    auto notice = read_notice(*head, packet.subspan(sizeof *head, head->nlmsg_len - sizeof *head));
    if (!notice) break;
    notices.push_back(std::move(*notice));
    packet = packet.subspan(std::min(up_to_4(head->nlmsg_len), packet.size()));
  }
  return notices;
}

std::vector<std::uint8_t> ask_link(std::uint32_t sequence, std::string_view name) {
  if (name.empty() || name.size() >= IFNAMSIZ) return {};
  RequestWriter out(RTM_GETLINK, 0, sequence, 0, 0, 0);
  out.attribute(IFLA_IFNAME, name);
  out.attribute(IFLA_EXT_MASK, static_cast<std::uint32_t>(RTEXT_FILTER_SKIP_STATS));
  return out.take();
}

std::vector<std::uint8_t> change_link(std::uint32_t sequence, int index, const LinkChange& change) {
  const unsigned flags = change.up.value_or(false) ? IFF_UP : 0;
  RequestWriter out(RTM_NEWLINK, NLM_F_ACK, sequence, index, flags, change.up ? IFF_UP : 0);
  if (change.bit_rate || change.listen_only || change.restart) write_controller(out, change);
  return out.take();
}

}  // namespace berth::io
