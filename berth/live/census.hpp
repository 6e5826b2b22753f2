/// Which nodes are on a bus that runs, without disturbing it: what is heard, and what a few careful SDO uploads add.
///
///     live::Census census(dispatcher);
///     ... listen for a while ...
///     co_await census.ask(options);          // may be left out: then only what was heard is known
///     for (const auto& node : census.nodes()) ...
///
/// Only 1000h, 1018h:01..04, 1017h, 1F80h, 1F81h:00 and 1008h..100Ah are uploaded (never block transfer), one request
/// at a time on the whole bus, with a pause between them. A node that another SDO client talks to is left alone: there
/// is one default channel, and two clients in it break each other's transfers. When such a client shows up while Berth
/// waits for an answer, the answer may be the other's: what was read is thrown away. A node that gives more than such
/// an object can hold, or trickles, is given up (`NodeSeen::problem`), and the others are asked.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "berth/can/dispatcher.hpp"
#include "berth/co/sdo_client.hpp"

namespace berth::live {

/// What is known of one node.
struct NodeSeen {
  NodeId id;
  std::uint32_t beats = 0;          ///< error control messages, boot-ups not counted
  rt::Duration period{0};           ///< of its heartbeat: as 1017h tells, else the median of the last 16; 0 = unknown
  std::optional<NmtState> state{};  ///< as it told last
  bool guarded = false;             ///< a master asks it by node guarding
  bool foreign_client = false;      ///< another SDO client talks to it
  bool nmt_master = false;          ///< 1F80h bit 0: a master, however quiet (CiA 302-2)
  std::optional<std::uint8_t> network_list{};  ///< 1F81h:00 of such a master: node-IDs that it may have in its care
  std::optional<std::uint32_t> device_type{};  ///< 1000h
  std::optional<Identity> identity{};          ///< 1018h, as far as it says it; empty: it was not asked
  std::string name{};                          ///< 1008h
  std::string hardware{};                      ///< 1009h
  std::string software{};                      ///< 100Ah
  std::string problem{};                       ///< why it was not asked, or did not tell its identity
};

struct CensusOptions {
  rt::Duration sdo_timeout = std::chrono::milliseconds(500);
  rt::Duration pause = std::chrono::milliseconds(20);  ///< between two requests
  rt::Duration client_gone = std::chrono::seconds(5);  ///< a foreign client silent for so long has left the node
  bool everybody = false;                              ///< nodes 1..127, not only those that were heard
  NodeId own{};                                        ///< Berth's node-ID: not asked
  std::vector<NodeId> known{};                         ///< not asked either: their identities are known
  bool masters_only = false;  ///< is it a master? 1F80h, and of a master 1F81h:00 and 1000h; nothing else is asked
  bool types = false;         ///< with `masters_only`: of the others 1018h:01 and :02
};

class Census final : private can::Handler {
 public:
  explicit Census(can::Dispatcher& dispatcher);

  /// Asks every node that was heard and may be asked. Errors: `bus` the port takes no frame.
  [[nodiscard]] rt::Task<Result<void>> ask(CensusOptions options);
  /// In the order of their node-IDs.
  [[nodiscard]] std::vector<NodeSeen> nodes() const;
  [[nodiscard]] std::uint64_t frames() const noexcept { return frames_; }
  /// Time between two SYNCs; 0 = none or one was heard.
  [[nodiscard]] rt::Duration sync_period() const noexcept { return sync_period_; }

 private:
  struct Node {
    NodeSeen seen;
    bool heard = false;
    std::optional<rt::Time> last_beat;
    std::vector<rt::Duration> gaps;
    std::optional<rt::Time> foreign;  // last frame of another client
  };
  void received(const can::Frame& frame, rt::Time at) noexcept override;
  void beat(Node& node, const can::Frame& frame, rt::Time at);
  [[nodiscard]] bool may_ask(const Node& node, const CensusOptions& options) const noexcept;
  rt::Task<Result<void>> ask_node(NodeId id, CensusOptions options);
  rt::Task<Result<co::SdoValue>> upload(NodeId id, ObjectRef ref, std::size_t most, CensusOptions options);
  rt::Task<Result<std::optional<std::uint32_t>>> number(NodeId id, ObjectRef ref, std::size_t size,
                                                        CensusOptions options);
  rt::Task<Result<void>> ask_period(Node& node, CensusOptions options);
  [[nodiscard]] rt::Task<Result<void>> ask_whether_master(Node& node, CensusOptions options);
  rt::Task<Result<void>> ask_stranger(NodeId id, CensusOptions options);
  rt::Task<void> ask_type(Node& node, CensusOptions options);
  rt::Task<Result<std::string>> text(NodeId id, std::uint16_t index, CensusOptions options);

  can::Dispatcher* dispatcher_;
  co::SdoClient sdo_;
  std::array<Node, 128> nodes_{};
  std::uint64_t frames_ = 0;
  std::optional<rt::Time> last_sync_;
  rt::Duration sync_period_{0};
};

}  // namespace berth::live
