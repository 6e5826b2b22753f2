// A packet of the kernel's about network interfaces: no crash, as many notices as there is room for, and the beginning
// of a packet gives the beginning of its notices.
#include <cstdint>
#include <span>

#include "berth/io/netlink.hpp"
#include "fuzz/require.hpp"

namespace netlink_target {

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace berth;
  using fuzz::require;
  const std::span<const std::uint8_t> packet(data, size);
  const auto notices = io::decode_links(packet);
  require(notices.size() <= size / 16);
  for (const auto& n : notices) {
    require(n.error >= 0 && n.error < 4096 && n.text.size() <= size && n.link.name.size() <= size);
    require(n.link.controller() || (n.link.bit_rate == 0 && !n.link.state));
    if (n.link.state) require(!io::to_string(*n.link.state).empty());
  }
  const auto fewer = io::decode_links(packet.first(size / 2));
  require(fewer.size() <= notices.size());
  for (std::size_t i = 0; i < fewer.size(); ++i)
    require(fewer[i].kind == notices[i].kind && fewer[i].link == notices[i].link);
  return 0;
}

}  // namespace netlink_target
