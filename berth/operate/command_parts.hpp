/// What the source files of the commands share.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <tl/expected.hpp>

#include "berth/co/nmt.hpp"
#include "berth/lss/frames.hpp"
#include "berth/od/data_type.hpp"
#include "berth/operate/commands.hpp"
#include "berth/operate/session.hpp"

namespace berth::operate {

using Json = nlohmann::ordered_json;
template <class T>
using Checked = tl::expected<T, std::string>;  ///< the error is for people

/// The arguments of one request, checked. The first thing wrong is kept in `problem`; what is read after that is a
/// default.
class Arguments {
 public:
  /// An argument that is not in `known` is wrong.
  Arguments(const CommandRequest& request, std::initializer_list<std::string_view> known);

  [[nodiscard]] bool has(const std::string& key) const;
  /// Empty when absent.
  [[nodiscard]] std::string text(const std::string& key) const;
  std::string required(const std::string& key);
  /// C notation. Absent: `fallback`, or wrong when there is none.
  std::uint32_t number(const std::string& key, std::uint32_t low, std::uint32_t high,
                       std::optional<std::uint32_t> fallback = std::nullopt);
  LssAddress address(const std::string& key);
  /// Empty when absent.
  std::optional<LssAddress> optional_address(const std::string& key);
  /// A node-ID; 0 for "all" when that is allowed.
  std::uint8_t node(const std::string& key, bool all_allowed);

  void wrong(std::string problem);
  [[nodiscard]] bool good() const noexcept { return problem_.empty(); }
  [[nodiscard]] const std::string& problem() const noexcept { return problem_; }

 private:
  const CommandRequest& request_;
  std::string problem_;
};

/// How a command uses a bus, for `design::Role`.
enum class Use : std::uint8_t { look, send, command };  ///< nothing, frames, NMT start or reset

/// The network that a command is for, or why there is none or it must not be used so.
[[nodiscard]] Checked<Network*> network_for(Session& session, const std::string& bus, Use use);
/// All buses when none is named.
[[nodiscard]] Checked<std::vector<Network*>> networks_for(Session& session, const std::string& bus, Use use);

void give(CommandReply& reply, const Json& json, std::vector<std::string> lines);
/// `message` for people, `fix` what to do.
void refuse(CommandReply& reply, int status, const std::string& message, const std::string& fix = {});
/// An error of a service: status by its code, abort code with its text. `where`: "bus backbone, SDO read".
void fail_with(CommandReply& reply, const Error& error, const std::string& where, const std::string& fix = {});

[[nodiscard]] std::string hex(std::uint32_t value, unsigned digits = 8);  ///< "0x0000000A"
[[nodiscard]] std::string dump(const Json& json);                         ///< one line; bad UTF-8 replaced
/// Adds "address", "type" and "r_sn".
void put_address(Json& json, const LssAddress& address);

/// The object that an SDO command is about.
struct ObjectArguments {
  std::string bus;
  NodeId node;
  std::uint16_t index = 0;
  std::uint8_t sub = 0;
  od::DataType type = od::DataType::none;
};
[[nodiscard]] ObjectArguments object_arguments(Arguments& arguments);
/// The bytes of a value as a person wrote it; type `none`: a row of hex bytes.
[[nodiscard]] Checked<std::vector<std::uint8_t>> value_bytes(od::DataType type, const std::string& text, NodeId node);
struct NmtArguments {
  std::string bus;
  co::NmtCommand command = co::NmtCommand::start;
  co::NmtTarget target;
  std::string word;
};
[[nodiscard]] NmtArguments nmt_arguments(Arguments& arguments);

/// What an LSS command is about; only what its service takes means something.
struct LssArguments {
  std::string service;
  std::string bus;
  std::optional<LssAddress> device;
  lss::State state = lss::State::waiting;
  NodeId id;
  bool store = false;
  std::uint32_t rate = 0;
  std::uint16_t delay_ms = 0;
  lss::IdentifyRanges ranges;
};
/// What is wrong is in `problem`.
[[nodiscard]] LssArguments lss_arguments(const CommandRequest& request, std::string& problem);

/// On a real bus (`Session::careful`) a command that disturbs operational devices needs "yes", and on every bus so does
/// "bind" from scratch; false: `reply` says so.
/// Takes "yes" out of requests that do not know it.
[[nodiscard]] bool confirmed(Session& session, CommandRequest& request, CommandReply& reply);

// The verbs (commands.cpp, command_sdo.cpp, command_eds.cpp, command_lss.cpp, command_locate.cpp).
rt::Task<void> configure(Session& session, const CommandRequest& request, CommandReply& reply);
rt::Task<void> locate(Session& session, const CommandRequest& request, CommandReply& reply);
rt::Task<void> sdo_read(Session& session, const CommandRequest& request, CommandReply& reply);
rt::Task<void> sdo_write(Session& session, const CommandRequest& request, CommandReply& reply);
rt::Task<void> sdo_probe(Session& session, const CommandRequest& request, CommandReply& reply);
rt::Task<void> nmt_command(Session& session, const CommandRequest& request, CommandReply& reply);
rt::Task<void> lss_command(Session& session, const CommandRequest& request, CommandReply& reply);
rt::Task<void> bit_rate_command(Session& session, const CommandRequest& request, CommandReply& reply);

}  // namespace berth::operate
