#define DUET_EIGEN Eigen_v4
#define DUET_KERNEL kDenseKernelsV4
#define DUET_LEVEL InstructionSet::kV4
#include "duet/nn/dense_kernels_body.h"
