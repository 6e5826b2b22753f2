// Any bytes at both ends of a socketcand connection, in pieces: the reader keeps no more than it may, and a frame that
// it takes for one is written and read back equal.
//
// Input: the first byte is the length of the pieces, the rest is the stream.
#include <algorithm>

#include "berth/io/socketcand_protocol.hpp"
#include "fuzz/require.hpp"

namespace socketcand_target {

namespace {

using namespace berth;
using fuzz::require;

void check(std::string_view element) {
  require(element.size() < io::longest_element);
  const auto command = io::parse_command(element);
  require(command.bus.size() <= element.size() && command.interval.count() >= 0);
  if (command.kind == io::SocketcandCommand::Kind::send) {
    require(io::socketcand_can_say(command.frame));
    std::string text;
    io::append_send(text, command.frame);
    io::ElementReader reader;
    reader.add(text);
    const auto again = reader.next();
    require(again && io::parse_command(*again).frame == command.frame);
  }
  const auto notice = io::parse_notice(element);
  if (notice.kind == io::SocketcandNotice::Kind::frame) {
    std::string text;
    io::append_frame(text, notice.frame, notice.at, element.size() % 2 == 0);
    io::ElementReader reader;
    reader.add(text);
    const auto next = reader.next();
    require(next.has_value());
    const auto again = io::parse_notice(*next);
    require(again.kind == notice.kind && again.frame == notice.frame && again.at == notice.at);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::size_t piece = std::max<std::size_t>(1, data[0]);
  std::string_view rest(reinterpret_cast<const char*>(data) + 1, size - 1);
  io::ElementReader reader;
  while (!rest.empty()) {
    const auto n = std::min(piece, rest.size());
    reader.add(rest.substr(0, n));
    rest.remove_prefix(n);
    while (const auto element = reader.next()) check(*element);
    require(reader.kept() <= io::longest_element);
    require(reader.faults() == 0 || reader.fault_at() < size);
  }
  return 0;
}

}  // namespace socketcand_target
