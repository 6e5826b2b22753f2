/// What the source files of the commands share.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <tl/expected.hpp>

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

void give(CommandReply& reply, const Json& json, std::vector<std::string> lines);
/// `message` for people, `fix` what to do.
void refuse(CommandReply& reply, int status, const std::string& message, const std::string& fix = {});
/// An error of a service: status by its code, abort code with its text. `where`: "bus backbone, SDO read".
void fail_with(CommandReply& reply, const Error& error, const std::string& where, const std::string& fix = {});

[[nodiscard]] std::string hex(std::uint32_t value, unsigned digits = 8);  ///< "0x0000000A"
[[nodiscard]] std::string dump(const Json& json);                        ///< one line; bad UTF-8 replaced
/// Adds "address", "type" and "r_sn".
void put_address(Json& json, const LssAddress& address);

// The verbs (commands.cpp, command_sdo.cpp, command_lss.cpp).
rt::Task<void> sdo_read(Session& session, const CommandRequest& request, CommandReply& reply);
rt::Task<void> sdo_write(Session& session, const CommandRequest& request, CommandReply& reply);
rt::Task<void> nmt_command(Session& session, const CommandRequest& request, CommandReply& reply);
rt::Task<void> lss_command(Session& session, const CommandRequest& request, CommandReply& reply);

}  // namespace berth::operate
