#include "sensors/black_box.h"

#include <mrpt/obs/CObservation.h>

#include <utility>

namespace raceloc {

BlackBox::BlackBox(const std::string& path, const LogHeader& header)
    : x_writer(path, header, 0), x_thread([this] {
        try {
          for (; const auto arrival = x_queue.pop(); ++x_written) x_writer.write(**arrival);
        } catch (...) {
          x_error = std::current_exception();
          x_queue.close();
        }
      }) {}

BlackBox::~BlackBox() {
  x_queue.close();
  if (x_thread.joinable()) x_thread.join();
}

void BlackBox::write(Arrival arrival) { x_queue.push(std::move(arrival)); }

void BlackBox::commit() {
  x_queue.close();
  x_thread.join();
  if (x_error) std::rethrow_exception(x_error);
  x_writer.commit();
}

}  // namespace raceloc
