#define DUET_EIGEN Eigen_portable
#define DUET_KERNEL kDenseKernelsPortable
#define DUET_LEVEL InstructionSet::kPortable
#include "duet/nn/dense_kernels_body.h"
