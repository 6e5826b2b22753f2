/// Watched objects: the carrier of requests reads them repeatedly by `sdo read`.
#pragma once

#include <string>
#include <tl/expected.hpp>
#include <vector>

#include "berth/command/objects.hpp"
#include "berth/command/reply.hpp"
#include "berth/design/machine.hpp"
#include "watch_rows.hpp"

namespace berth::cli {

/// One reading of one object.
struct Reading {
  std::size_t row = 0;  ///< index in `Watched::rows`
  std::string json;     ///< one object: the result of `sdo read`, preceded by `watched`
};

class Watched {
 public:
  /// `words`: SLOT/OBJECT each; the slot is a node as `sdo read` takes it ("left", "line/left", "5", "3/5"), the object
  /// too, or the name of a network variable. `bus`: of --bus. The error is for people.
  [[nodiscard]] static tl::expected<Watched, std::string> of(const design::Machine& machine, const std::string& bus,
                                                             const std::vector<std::string>& words);

  /// One for each node, and more if types of its network variables must be given.
  [[nodiscard]] const std::vector<command::Request>& requests() const noexcept { return requests_; }
  /// Takes the answer to a request, by its index; `at`: when it came.
  std::vector<Reading> take(std::size_t request, const command::Reply& reply, rt::Time at);
  /// The request was not sent now: why.
  void pass_over(std::size_t request, const std::string& why);
  [[nodiscard]] const std::vector<WatchRow>& rows() const noexcept { return rows_; }
  /// As the user wrote it.
  [[nodiscard]] const std::string& word(std::size_t row) const noexcept { return words_[row]; }
  /// The slot that a request asks. No bus: it is unknown.
  struct Where {
    std::string bus;
    NodeId node;
  };
  [[nodiscard]] const Where& where(std::size_t request) const noexcept { return where_[request]; }

 private:
  // The request for this node, with this type unless it is empty.
  std::size_t request_for(const std::string& bus, const std::string& node, const std::string& type, const Where& where);
  void add_row(const std::string& word, const std::string& slot, const std::string& shown, std::size_t request,
               const std::string& object);
  std::vector<std::string> words_;  // by row
  std::vector<WatchRow> rows_;
  std::vector<command::Request> requests_;
  std::vector<std::vector<std::size_t>> rows_of_;  // by request: in the order of its objects
  std::vector<Where> where_;                       // by request
};

}  // namespace berth::cli
