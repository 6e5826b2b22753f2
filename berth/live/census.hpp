/// Finds which nodes are on a running bus without disturbing it: by listening, and by a few careful SDO uploads.
///
///     live::Census census(dispatcher);
///     ... listen for a while ...
///     co_await census.ask(options);          // may be left out: then only what was heard is known
///     for (const auto& node : census.nodes()) ...
///
/// It uploads only 1000h, 1018h:01..04, 1017h, 1F80h, 1F81h:00 and 1008h..100Ah (never by block transfer), one request
/// at a time on the whole bus, with a pause between them. It does not ask a node that another SDO client uses: there is
/// only one default channel, and two clients break each other's transfers. If such a client appears while Berth waits
/// for an answer, the answer may be the other's and is discarded. A node that sends more than such an object can hold,
/// or sends it too slowly, is given up (`NodeSeen::problem`), and the others are asked.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "berth/can/dispatcher.hpp"
#include "berth/co/sdo_client.hpp"

namespace berth::live {

/// What is known about one node.
struct NodeSeen {
  NodeId id;
  std::uint32_t beats = 0;          ///< error control messages, without boot-ups
  rt::Duration period{0};           ///< of its heartbeat: from 1017h, else the median of the last 16; 0 = unknown
  std::optional<NmtState> state{};  ///< its last reported one
  bool guarded = false;             ///< a master guards it
  bool foreign_client = false;      ///< another SDO client uses it
  bool nmt_master = false;          ///< 1F80h bit 0: a master, however quiet (CiA 302-2)
  std::optional<std::uint8_t> network_list{};  ///< 1F81h:00 of such a master: number of node-IDs it may manage
  std::optional<std::uint32_t> device_type{};  ///< 1000h
  std::optional<Identity> identity{};          ///< 1018h, the known parts; empty: not asked
  std::string name{};                          ///< 1008h
  std::string hardware{};                      ///< 1009h
  std::string software{};                      ///< 100Ah
  std::string problem{};                       ///< why it was not asked, or did not give its identity
};

struct CensusOptions {
  rt::Duration sdo_timeout = std::chrono::milliseconds(500);
  rt::Duration pause = std::chrono::milliseconds(20);  ///< between two requests
  rt::Duration client_gone = std::chrono::seconds(5);  ///< a foreign client that is silent for so long has left the
                                                       ///< node
  bool everybody = false;                              ///< nodes 1..127, not only those that were heard
  NodeId own{};                                        ///< Berth's node-ID: not asked
  std::vector<NodeId> known{};                         ///< not asked: their identities are known
  bool masters_only = false;  ///< asks only whether it is a master: 1F80h, and of a master 1F81h:00 and 1000h
  bool types = false;         ///< with `masters_only`: also 1018h:01 and :02 of the others
};

class Census final : private can::Handler {
 public:
  explicit Census(can::Dispatcher& dispatcher);

  /// Asks every heard node that may be asked. Errors: `bus` the port takes no frame.
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
