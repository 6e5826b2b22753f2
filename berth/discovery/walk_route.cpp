#include "berth/discovery/walk_route.hpp"

namespace berth::discovery::walk {

rt::Task<void> Route::round() {
  while (q_.way().sub < 3) {
    const Path* const path = paths_.choose(q_.way(), q_.children(), report_.found);
    if (path != nullptr) {
      Path tried{.part = q_.way().part, .parts = q_.way().sub + 1};
      tried.part[q_.way().sub] = path->part[q_.way().sub];
      const bool entered = co_await q_.enter(tried.part[q_.way().sub]);
      if (q_.is_broken()) co_return;
      if (!entered) {
        paths_.note_absent(tried);
        co_return;
      }
      continue;
    }
    q_.frontier().clear();
    const Prefix root;
    descent_.begin(root);
    bool found = co_await descent_.down(root, q_.entered_answers());
    if (found && !q_.is_broken()) found = co_await descent_.enter_leaf();
    if (!found || q_.is_broken()) co_return;
  }
  const bool same = q_.way().part == last_chain_;
  const auto before = report_.found.size();
  const bool one_before = last_found_ == 1;
  co_await serials_.all();
  const bool found = report_.found.size() > before;
  if (same && one_before && found) serials_.note_one_each_round();
  last_chain_ = q_.way().part;
}

}  // namespace berth::discovery::walk
